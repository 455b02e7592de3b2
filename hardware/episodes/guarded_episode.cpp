#include "duet/hardware/episodes/guarded_episode.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <utility>

#include "duet/core/file.h"
#include "duet/core/numbers.h"
#include "duet/core/require.h"
#include "duet/core/robot_state.h"
#include "duet/hardware/guard/guard_loop.h"
#include "duet/hardware/twin/lock_step.h"
#include "duet/motion/human_motion.h"
#include "duet/robots/robot_cards.h"
#include "duet/rows/groups/row_groups.h"
#include "duet/rows/json_fields.h"

namespace duet {
namespace {

constexpr double kRest = 0.2;  // that it is told to stand for after an episode [s]

GuardedEpisode guarded_episode(const RolloutSetup& setup, const RobotModel& robot, const GuardedOptions& options,
                               const PointTracks& partner) {
  GuardedEpisode episode;
  episode.limits = options.config.limits;
  episode.least_steps = options.least_steps;
  for (const std::vector<int>& arm : robot.roles.arms)
    episode.joints.insert(episode.joints.end(), arm.begin(), arm.end());
  if (options.solid) {
    require(setup.limits.has_value(), "episode: expected limits of contact for a solid person, found none");
    episode.solid = SolidPerson{make_human_body(bone_lengths(setup.clip->partner)), *setup.limits};
  }
  episode.watch = options.watch;
  episode.keeps_distance = options.config.twin && options.config.person;
  const bool by_clip = options.config.twin && !options.own_camera && !partner.empty();
  if (by_clip) episode.person = partner_of_clip(partner, options.camera);
  episode.perceives = options.own_camera || (by_clip && !options.policy_sees_clip);
  episode.records_seen = options.own_camera;
  return episode;
}

// By the recording: where the person is, not where they were seen.
double least_head_distance(const Recording& recording, const std::shared_ptr<const RobotModel>& robot,
                           const HumanMotion& person) {
  BodyDistance distance(robot, make_human_body(bone_lengths(person)), {});
  double least = BodyGaps::kFar;
  for (int k = 0; k < std::min(recording.frames(), recording.partner.frames()); ++k) {
    const HumanJoints joints = recording.partner.frame(k);
    const RobotState& state = recording.robot[static_cast<std::size_t>(k)];
    least = std::min(least, distance.measure(state.X_WB, state.q, &joints, 0.0, false).head);
  }
  return least;
}

Rollout roll_out_guarded(const RolloutSetup& setup, const std::shared_ptr<const RobotModel>& robot, Policy& policy,
                         GuardLink& link, const GuardedOptions& options, GuardedRun& run) {
  GuardedEpisode episode = guarded_episode(setup, *robot, options, episode_partner(setup).joints);
  run.executed = executed_mask(*robot, episode.joints, true);
  GuardedWorld world(std::move(episode), robot, link);
  Rollout rollout = roll_out(setup, world, policy, options.engine);
  run.interrupted = std::exchange(rollout.interrupted, false);
  run.clamps = world.clamps();
  run.held_ticks = world.held_ticks();
  run.unseen_ticks = world.unseen_ticks();
  run.head_distance = least_head_distance(rollout.recording, robot, setup.clip->partner);
  run.guard_seconds = world.report().now - world.began_at();
  run.missed_reports = world.missed_reports();
  if (!options.recording.empty()) save_logged_run(rollout.recording, run.executed, options.recording);
  world.rest(kRest);
  return rollout;
}

std::string share_text(long k, long n, const Interval& interval) {
  return fmt::format("{} of {} = {:.1f} % [{:.1f}, {:.1f}]", k, n, n > 0 ? 100.0 * static_cast<double>(k) / n : 0.0,
                     100.0 * interval.low, 100.0 * interval.high);
}

}  // namespace

GuardedRun run_guarded_episode(const Experiment& experiment, const EpisodeSpec& spec, GuardLink& link,
                               const GuardedOptions& options) {
  GuardedRun run;
  const auto in_world = [&](const RolloutSetup& setup, Policy& policy) {
    return roll_out_guarded(setup, spec.body->robot, policy, link, options, run);
  };
  run.row = experiment.run(spec, {.stop_asked = options.stop_asked, .engine = options.engine, .world = in_world});
  return run;
}

PairedSuccess paired_success(const PairedEpisodes& episodes) {
  require(episodes.simulated.size() == episodes.guarded.size(),
          "paired episodes: expected as many rows of both, found {} and {}", episodes.simulated.size(),
          episodes.guarded.size());
  PairedSuccess result;
  result.n = static_cast<long>(episodes.simulated.size());
  EpisodePairs pairs;
  for (std::size_t i = 0; i < episodes.simulated.size(); ++i) {
    pairs.add(episodes.guarded[i], episodes.simulated[i]);
    const bool a = episodes.simulated[i].success.value_or(false), b = episodes.guarded[i].success.value_or(false);
    result.simulated += a ? 1 : 0;
    result.guarded += b ? 1 : 0;
    ++(a ? (b ? result.both : result.only_simulated) : (b ? result.only_guarded : result.neither));
  }
  result.simulated_95 = wilson(result.simulated, result.n);
  result.guarded_95 = wilson(result.guarded, result.n);
  result.difference_95 = newcombe_paired(result.both, result.only_guarded, result.only_simulated, result.neither);
  if (result.n > 0) result.p = pairs.p();
  result.clips = pairs.clips();
  const double share = result.n > 0 ? static_cast<double>(result.guarded) / static_cast<double>(result.n) : 0.0;
  result.inside = share >= result.simulated_95.low && share <= result.simulated_95.high;
  return result;
}

std::string paired_text(const PairedSuccess& success, const std::string& simulated, const std::string& guarded) {
  return fmt::format(
      "{:<24} {}\n{:<24} {}\nthe same episodes: both {}, only {} {}, only {} {}, neither {}\ndifference {:+.1f} points "
      "[{:.1f}, {:.1f}] (Newcombe, paired), exact test by clip over {} clips p = {:.3f}; {} lies {} the interval of {}",
      simulated, share_text(success.simulated, success.n, success.simulated_95), guarded,
      share_text(success.guarded, success.n, success.guarded_95), success.both, simulated, success.only_simulated,
      guarded, success.only_guarded, success.neither,
      success.n > 0 ? 100.0 * static_cast<double>(success.guarded - success.simulated) / success.n : 0.0,
      100.0 * success.difference_95.low, 100.0 * success.difference_95.high, success.clips, success.p, guarded,
      success.inside ? "inside" : "outside", simulated);
}

nlohmann::json paired_json(const PairedSuccess& success) {
  const auto interval = [](const Interval& values) { return nlohmann::json{values.low, values.high}; };
  return {{"n", success.n},
          {"simulated", success.simulated},
          {"guarded", success.guarded},
          {"both", success.both},
          {"only_simulated", success.only_simulated},
          {"only_guarded", success.only_guarded},
          {"neither", success.neither},
          {"simulated_95", interval(success.simulated_95)},
          {"guarded_95", interval(success.guarded_95)},
          {"difference_95", interval(success.difference_95)},
          {"clips", success.clips},
          {"p", success.p},
          {"inside", success.inside}};
}

Suite suite_of_clip(const std::string& clip, const std::string& policy, const std::string& start,
                    const std::string& controller) {
  const std::string file = std::filesystem::absolute(clip).lexically_normal().string();
  const nlohmann::json quoted = file;  // JSON's strings are YAML's
  std::vector<std::string_view> tasks;
  for (const Task task : all_tasks()) tasks.push_back(to_string(task));
  return parse_suite(
      fmt::format("schema: duet.suite/1\nname: hw-run\nversion: 1.0.0\nclips: {{files: [{}]}}\ntasks: [{}]\nengines: "
                  "[playback]\ncontrollers: [{}]\npolicies: [{}]\nrobot: {}\nstart: {}\nnull_arm: false\n",
                  dumped(quoted), fmt::join(tasks, ", "), controller, policy, default_robot(), start),
      "hw-run.yaml");
}

namespace {

constexpr int kPersonRate = 30;    // [Hz]
constexpr double kStandOff = 3.0;  // of a person while the robot is stood up, beyond where the clip has them [m]
constexpr double kWalkUp = 1.2;    // a person's walking pace [m/s]

// Whether a picture of 30 in a second falls into this tick.
bool sees_at(int tick) { return tick == 0 || tick * kPersonRate / 50 != (tick - 1) * kPersonRate / 50; }

std::string place_of(const GuardReport& report) {
  return fmt::format("{} ({})", safety_state_name(report.state), stop_cause_name(report.cause));
}

}  // namespace

TwinCamera parse_twin_camera(const std::string& text) {
  struct Word {
    const char* name;
    double TwinCamera::*value;
    double most;
  };
  static constexpr Word kWords[] = {{"noise", &TwinCamera::noise, 1.0},
                                    {"latency", &TwinCamera::latency, 0.25},
                                    {"unseen", &TwinCamera::unseen, 1.0},
                                    {"jumps", &TwinCamera::jumps, 1.0}};
  TwinCamera camera;
  if (text.empty()) return camera;
  for (const std::string_view word : split(text, ',')) {
    const std::size_t equals = word.find('=');
    const auto* known = std::find_if(std::begin(kWords), std::end(kWords),
                                     [&](const Word& one) { return word.substr(0, equals) == one.name; });
    const std::optional<double> value =
        equals == std::string_view::npos ? std::nullopt : parse_number(word.substr(equals + 1));
    require(
        known != std::end(kWords) && value && *value >= 0.0 && *value <= known->most,
        "a twin's camera: expected noise (to 1 m), latency (to 0.25 s), unseen or jumps (shares to 1) with a value, "
        "as 'noise=0.02,latency=0.1', found '{}'",
        excerpt(word));
    camera.*known->value = *value;
  }
  return camera;
}

PartnerSource partner_of_clip(PointTracks partner, const TwinCamera& camera) {
  static constexpr double kAside = 1.0;  // of somebody else who is taken for the person [m]
  Random random(camera.seed, stream_key({"twin-camera"}));
  const int late = ticks_of(camera.latency);
  return [partner = std::move(partner), camera, random, late](int tick, PersonMessage& seen) mutable {
    if (partner.empty() || !sees_at(tick) || random.chance(camera.unseen)) return false;
    seen.joints = partner_joints(partner, tick - late);
    seen.latency = late * kTick;
    if (random.chance(camera.jumps)) seen.joints.row(1).array() += kAside;
    if (camera.noise > 0.0)
      for (Eigen::Index k = 0; k < seen.joints.size(); ++k) seen.joints.data()[k] += camera.noise * random.normal();
    return true;
  };
}

GuardedWorld::GuardedWorld(GuardedEpisode episode, std::shared_ptr<const RobotModel> robot, GuardLink& link)
    : episode_(std::move(episode)),
      robot_(std::move(robot)),
      link_(link),
      velocity_(episode_.odometry, episode_.limits, episode_.least_steps),
      fall_(robot_->fall) {
  message_to_guard_.command.q = robot_->neutral;
  target_ = robot_->neutral;
  state_ = robot_->standing_state();
  if (episode_.solid) {
    twin_ = link.in_process();
    require(twin_ != nullptr, "episode: expected a twin in this process for a solid person, found {}", link.name());
    twin_->twin().meet(episode_.solid->body);
    ContactSafetyOptions options;
    options.link_radius = link_radii(*robot_);
    safety_.emplace(episode_.solid->body, episode_.solid->limits, kTwinPeriod, options);
  }
  // Above whatever a planner before this one has sent.
  person_.sequence = message_to_guard_.sequence = static_cast<std::uint64_t>(monotonic_seconds() * 1e6);
}

GuardedWorld::~GuardedWorld() {
  if (twin_ != nullptr) twin_->after_step = {};
}

bool GuardedWorld::next() {
  const std::uint64_t before = report_.tick;
  if (!link_.next(report_)) {
    message_ = fmt::format("{} has gone: no report in {} s", link_.name(), link_.patience());
    return false;
  }
  if (report_.state != last_state_ && episode_.watch) episode_.watch(report_);
  last_state_ = report_.state;
  if (before > 0 && report_.tick > before) missed_ += static_cast<int>((report_.tick - before) / kReportEvery) - 1;
  return true;
}

void GuardedWorld::plan(const VelocityCommand& root, const Eigen::VectorXd& q, bool acting) {
  ++message_to_guard_.sequence;
  message_to_guard_.command.stamp = report_.now;
  message_to_guard_.command.root = root;
  message_to_guard_.command.q = q;
  message_to_guard_.acting = acting;
  (void)link_.send(message_to_guard_);
}

void GuardedWorld::wait_for_run(const Pose& start) {
  const double asked_at = report_.now;
  stand_off_ = episode_.keeps_distance ? kStandOff : 0.0;
  while (report_.state != SafetyState::kRun || stand_off_ > 0.0 || (episode_.perceives && !report_.tracked)) {
    const bool late = report_.now - asked_at > episode_.most_wait;
    if (late && report_.state == SafetyState::kRun)
      throw std::runtime_error(
          fmt::format("{} tracks nobody: an episode begins with a person whom the robot sees; none "
                      "was there for {:.1f} s",
                      link_.name(), report_.now - asked_at));
    if (report_.state >= SafetyState::kDamp || late)
      throw std::runtime_error(fmt::format("{} does not run: it is at {} after {:.1f} s", link_.name(),
                                           place_of(report_), report_.now - asked_at));
    if (report_.state == SafetyState::kRun) stand_off_ = std::max(stand_off_ - kWalkUp * kTick, 0.0);
    lay_world(start);
    show_person(0);
    plan({0.0, 0.0, 0.0, episode_.limits.height}, robot_->neutral, false);
    if (!next()) throw std::runtime_error(message_);
  }
}

void GuardedWorld::begin(const RobotState& start) {
  if (!next()) throw std::runtime_error(message_);
  message_to_guard_.goal.reset();
  wait_for_run(start.X_WB);
  lay_world(start.X_WB);
  velocity_.reset();
  missed_ = 0;
  began_at_ = report_.now;
  clamps_before_ = report_.clamps;
  take_state();
  if (twin_ != nullptr) twin_->after_step = [this] { safety_->add(twin_->twin().physics()->contacts()); };
}

void GuardedWorld::lay_world(const Pose& start) {
  const Pose& X_OB = report_.robot.X_WB;
  yaw_OE_ = yaw_of(X_OB.R) - yaw_of(start.R);
  p_OE_ = X_OB.p - yaw_rotation(yaw_OE_) * start.p;
  p_OE_.z() = 0.0;
}

Pose GuardedWorld::to_odometry(const Pose& X_EB) const {
  const Eigen::Quaterniond R_OE = yaw_rotation(yaw_OE_);
  return {R_OE * X_EB.R, p_OE_ + R_OE * X_EB.p};
}

HumanJoints GuardedWorld::to_odometry(const HumanJoints& p_E) const {
  const Eigen::Quaterniond R_OE = yaw_rotation(yaw_OE_);
  HumanJoints p_O;
  for (int j = 0; j < kSmplJoints; ++j) p_O.col(j) = p_OE_ + R_OE * p_E.col(j).eval();
  return p_O;
}

void GuardedWorld::take_state() {
  const Eigen::Quaterniond R_EO = yaw_rotation(-yaw_OE_);
  state_ = report_.robot;
  state_.X_WB = {R_EO * report_.robot.X_WB.R, R_EO * (report_.robot.X_WB.p - p_OE_)};
  state_.v_WB = R_EO * report_.robot.v_WB;
  if (report_.tracked)
    for (int j = 0; j < kSmplJoints; ++j) seen_.col(j) = R_EO * (report_.person.col(j) - p_OE_);
  for (std::size_t k = 0; k < kClampReasons; ++k) clamps_[k] = report_.clamps[k] - clamps_before_[k];
}

void GuardedWorld::show_person(int tick) {
  if (!episode_.person || !episode_.person(tick, person_)) return;
  person_.joints = to_odometry(person_.joints);
  if (stand_off_ > 0.0) {
    Eigen::Vector3d away = person_.joints.col(0) - report_.robot.X_WB.p;
    away.z() = 0.0;
    person_.joints.colwise() += stand_off_ * away.normalized();
  }
  ++person_.sequence;
  (void)link_.send(person_);
}

// On its way at the speed that the clip has; in the frame of odometry, which is the twin's own but for its noise.
void GuardedWorld::move_person(const PointTracks& partner, int tick) {
  if (twin_ == nullptr) return;
  const Eigen::Quaterniond R_OE = yaw_rotation(yaw_OE_);
  HumanJoints velocities = partner_velocities(partner, tick, kTickRate);
  for (int j = 0; j < kSmplJoints; ++j) velocities.col(j) = R_OE * velocities.col(j).eval();
  twin_->twin().physics()->move_person(to_odometry(partner_joints(partner, tick)), velocities);
}

void GuardedWorld::take_contacts() {
  if (twin_ == nullptr) return;
  const Eigen::Quaterniond R_EO = yaw_rotation(-yaw_OE_);
  const std::span<const Contact> contacts = twin_->twin().physics()->contacts();
  contacts_.assign(contacts.begin(), contacts.end());
  for (Contact& contact : contacts_) {
    contact.p_WC = R_EO * (contact.p_WC - p_OE_);
    contact.f_W = R_EO * contact.f_W;
  }
}

void GuardedWorld::finish(Rollout& rollout) const {
  if (safety_) rollout.safety = safety_->result();
}

// The guard gets what the reference asks for; what it makes of it is in its next report.
const Eigen::VectorXd& GuardedWorld::target(const Reference& reference) {
  const Reference goal{to_odometry(reference.X_WB), reference.q};
  const OdometrySample odometry{report_.robot.X_WB, report_.robot.v_WB, report_.odometry_at, report_.odometry};
  const VelocityCommand root = velocity_.update(odometry, goal, report_.now);
  show_person(tick_);
  message_to_guard_.goal = goal.X_WB;
  plan(root, reference.q, true);
  target_ = report_.q_target;
  for (const int joint : episode_.joints) target_[joint] = reference.q[joint];
  return target_;
}

Outcome GuardedWorld::advance(int tick, const PointTracks& partner, Deadline&) {
  tick_ = tick + 1;
  move_person(partner, tick);
  if (!next()) return Outcome::kError;
  take_state();
  take_contacts();
  if (report_.state == SafetyState::kHold) ++held_ticks_;
  if (!report_.tracked) ++unseen_ticks_;
  if (has_fallen(state_, fall_)) return Outcome::kFell;
  if (report_.state == SafetyState::kRun || report_.state == SafetyState::kHold) return Outcome::kOk;
  message_ = fmt::format("{} ended the run at {:.2f} s: {}", link_.name(), (tick + 1) * kTick, place_of(report_));
  return Outcome::kError;
}

void GuardedWorld::rest(double seconds) {
  if (twin_ != nullptr) twin_->after_step = {};
  const double end = report_.now + seconds;
  message_to_guard_.goal.reset();
  while (report_.now < end) {
    show_person(tick_);
    plan({0.0, 0.0, 0.0, episode_.limits.height}, robot_->neutral, false);
    if (!next()) return;
  }
}

}  // namespace duet
