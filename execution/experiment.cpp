#include "duet/execution/experiment.h"

#include <fmt/chrono.h>
#include <fmt/format.h>

#include <filesystem>
#include <new>
#include <utility>

#include "duet/archives/recording_file.h"
#include "duet/backends/actuation.h"
#include "duet/backends/engine_module.h"
#include "duet/backends/narrow_phase.h"
#include "duet/core/machine.h"
#include "duet/core/require.h"
#include "duet/core/robot_state.h"
#include "duet/experiment/plan/actuation_limits.h"
#include "duet/experiment/plan/episode.h"
#include "duet/experiment/work/run_work.h"
#include "duet/experiment/work/stop_token.h"
#include "duet/rows/groups/row_groups.h"
#include "duet/scoring/scoring.h"

namespace duet {
namespace {

std::string trajectory_path(const std::string& folder, const EpisodeRow& row) {
  return (std::filesystem::path(folder) / (row.key.substr(0, 16) + ".npz")).string();
}

std::unique_ptr<Policy> policy_of(const EpisodeSpec& spec, const EpisodeOverrides& overrides) {
  if (overrides.policy) return overrides.policy();
  require(spec.leader != nullptr, "policy '{}' was left out", spec.policy->name);
  return spec.leader->make();
}

std::string digest_of(const std::map<std::string, std::string>& digests, const std::string& name) {
  const auto found = digests.find(name);
  return found == digests.end() ? "" : found->second;
}

bool signalled() { return interrupt() != Interrupt::kNone; }

}  // namespace

std::string utc_now() { return fmt::format("{:%Y-%m-%dT%H:%M:%SZ}", fmt::gmtime(std::time(nullptr))); }

EpisodeRow ended_row(EpisodeRow row, Outcome outcome, const std::string& message) {
  if (row.started_at.empty()) row.started_at = utc_now();
  row.outcome = outcome;
  row.message = message;
  row.success = false;
  return row;
}

ExperimentOptions only(const EpisodeFilter& chosen, const Suite& suite) {
  return {.skipped_controllers = left_out(chosen.controllers, suite.controller_names()),
          .skipped_policies = left_out(chosen.policies, suite.policy_names())};
}

Experiment::Experiment(Suite suite, ExperimentOptions options)
    : suite_(std::move(suite)),
      part_(std::move(options.part)),
      bodies_(suite_, options.skipped_controllers, options.skipped_policies, options.called),
      identity_(identity_of(suite_, bodies_.read())),
      rules_{suite_.detector, suite_.thresholds, suite_.metric_readings()} {
  for (const std::string& policy : options.led) identity_.policies[policy].clear();
}

void Experiment::prepare(int threads, Progress& progress, PrepareOptions options) {
  options.files = &identity_.files;
  take_clips(prepare_clips(suite_, *bodies_.nominal(), threads, progress, options));
}

void Experiment::take_clips(std::vector<PairedMotion> clips) {
  plan_.reset();
  bodies_.take_clips(std::move(clips));
  plan_.emplace(suite_, bodies_, part_);
}

const EpisodePlan& Experiment::plan() const {
  if (!plan_) throw std::logic_error("experiment: expected clips before its episodes");
  return *plan_;
}

EpisodeRow Experiment::row(const EpisodeSpec& spec) const {
  EpisodeRow row;
  row.suite = suite_.name;
  row.suite_version = suite_.version;
  row.suite_hash = identity_.suite_hash;
  row.task = spec.reference == nullptr ? std::string(to_string(spec.clip->task)) : std::string(kWalkRows);
  row.clip = spec.clip->clip_id;
  row.episode = spec.episode;
  row.seed = spec.seed;
  row.engine = spec.engine;
  if (spec.settings != nullptr) {
    row.engine_profile = suite_.profile.name;
    row.profile_digest = settings_digest(spec.engine, *spec.settings);
  }
  row.controller = spec.controller->name;
  row.controller_digest = digest_of(identity_.controllers, spec.controller->name);
  row.policy = spec.policy->name;
  row.policy_digest = digest_of(identity_.policies, spec.policy->name);
  row.detectors = kDetectorsVersion;
  row.perturbation = spec.perturbation->name;
  row.arm = spec.arm;
  row.robot_digest = spec.body->robot->digest;
  row.tags = RowTags(episode_tags(spec));
  row.key = episode_key(row);
  return row;
}

std::string Experiment::lack_of(const EpisodeSpec& spec) {
  if (!spec.body->refusal.empty() && spec.engine != kPlaybackEngine) return spec.body->refusal;
  return spec.leader == nullptr ? "" : spec.leader->refusal;
}

std::unique_ptr<Controller> Experiment::controller(const EpisodeSpec& spec) {
  const SuiteController& named = *spec.controller;
  ControllerOptions options = named.options;
  if (spec.reference != nullptr) options = with_command(about(named), options, *spec.reference);
  require(spec.body->loaded.make != nullptr, "controller '{}' was left out", named.name);
  return spec.body->loaded.make(options);
}

Scene Experiment::scene(const EpisodeSpec& spec) const {
  const EngineSettings settings = settings_under(*spec.perturbation, *spec.settings);
  Scene scene;
  scene.robot = with_armature(perturbed_robot(*spec.perturbation, spec.body->robot), settings.armature);
  scene.friction.robot_ground = spec.perturbation->friction.value_or(scene.friction.robot_ground);
  scene.partner = scene_mode(suite_.partner);
  if (spec.reference == nullptr) {
    std::array<double, kSmplJoints> bones = bone_lengths(spec.clip->partner);
    if (spec.perturbation->partner)
      for (double& bone : bones) bone *= spec.perturbation->partner->scale;
    scene.human = make_human_body(bones);
  }
  scene.dt = settings.dt;
  scene.law = settings.law;
  scene.options = settings.options;
  return scene;
}

EpisodeConditions Experiment::conditions(const EpisodeSpec& spec, const Pose& start) const {
  EpisodeConditions conditions;
  conditions.start = spec.body->robot->standing_state(start);
  conditions.perturbation = *spec.perturbation;
  conditions.perturbation_seed = spec.perturbation_seed;
  conditions.fall = spec.body->robot->fall;
  conditions.wall_limit = suite_.wall_limit;
  conditions.stop_asked = signalled;
  conditions.partner_yields = suite_.partner == SuitePartner::kYielding;
  return conditions;
}

// A start of `approach` that lies in a solid partner is drawn again.
void Experiment::draw_clear_start(const EpisodeSpec& spec, const AdaptationOptions& options,
                                  RolloutSetup& setup) const {
  if (options.start != StartMode::kApproach || spec.engine == kPlaybackEngine ||
      scene_mode(suite_.partner) != PartnerMode::kSolid)
    return;
  constexpr int kMostDraws = 50;
  const Scene scene = this->scene(spec);
  const HumanJoints partner = partner_joints(episode_partner(setup).joints, 0);
  for (int draw = 1; draw < kMostDraws && is_in_partner(scene, setup.start, partner); ++draw) {
    const std::uint64_t seed = stream_key({"start", std::to_string(spec.seed), std::to_string(draw)});
    setup.reference = adapt_by_phase(spec.clip->robot, spec.clip->phases, *spec.body->robot, options, seed);
    setup.start = spec.body->robot->standing_state(setup.reference.motion.root.front());
  }
}

RolloutSetup Experiment::setup(const EpisodeSpec& spec) const {
  const RobotModel& robot = *spec.body->robot;
  AdaptationOptions options;
  options.start = suite_.start_of(*spec.controller);
  options.start_radius = suite_.start_radius;
  AdaptedMotion reference = adapt_by_phase(spec.clip->robot, spec.clip->phases, robot, options, spec.seed);
  RolloutSetup setup;
  static_cast<EpisodeConditions&>(setup) = conditions(spec, reference.motion.root.front());
  setup.clip = spec.clip;
  setup.reference = std::move(reference);
  draw_clear_start(spec, options, setup);
  setup.prompt = spec.policy->prompt;
  if (spec.seen != nullptr)
    setup.seen_partner = partner_from_elsewhere(
        *spec.seen, adapt_by_phase(spec.seen->robot, spec.seen->phases, robot, options, spec.seed), setup.reference);
  setup.seed = spec.seed;
  setup.foot_trace = spec.engine != kPlaybackEngine && spec.arm == "main" && about(*spec.controller).walks;
  setup.fuse_ticks = suite_.fuse_ticks;
  setup.max_root_speed = suite_.max_root_speed;
  setup.limits = bodies_.limits();
  return setup;
}

bool Experiment::keeps(const EpisodeRow& row, const EpisodeOverrides& overrides) const {
  if (overrides.trajectories.empty()) return false;
  if (overrides.record_all || suite_.record == RecordTrajectories::kAll) return true;
  return suite_.record == RecordTrajectories::kFailures && !row.success.value_or(false);
}

// Runs in the spec's engine or without physics; `leader`: a policy, or the source of a reference.
template <typename Setup, typename Leader>
Rollout Experiment::executed(const EpisodeSpec& spec, const Setup& setup, Leader& leader, EpisodeRow& row) const {
  row.engine_version = "1";  // of playback
  if (spec.engine == kPlaybackEngine) return play_back(setup, leader);
  const std::unique_ptr<Backend> backend = make_backend(spec.engine, scene(spec));
  row.engine_version = backend->version();
  return roll_out(setup, *backend, *controller(spec), leader);
}

// The neutral pose, with the joints that a controller leaves to the reference where it was made to have them.
Eigen::VectorXd posture_of(const SuiteController& controller, const RobotModel& robot) {
  Eigen::VectorXd q = robot.neutral;
  for (const auto& [name, angle] : about(controller).posture)
    if (const int joint = robot.joint_index(name); joint >= 0) q[joint] = angle;
  return q;
}

// An episode that a commanded velocity leads.
void Experiment::simulate_walk(const EpisodeSpec& spec, const EpisodeOverrides& overrides, EpisodeRow& row) const {
  require(!overrides.world, "episode: expected one of a clip, found a walking command");
  Episode episode{conditions(spec, {}), ticks_of(spec.reference->seconds), {}, nullptr};
  episode.start.q = posture_of(*spec.controller, *spec.body->robot);
  StreamOptions options = stream_options(*spec.reference);
  options.posture = episode.start.q;
  StreamReference stream(spec.body->robot, options, spec.seed);
  if (overrides.stop_asked) episode.stop_asked = overrides.stop_asked;
  const Rollout rollout = executed(spec, episode, stream, row);
  if (rollout.interrupted) throw EpisodeInterrupted();
  score_walk(rollout, *spec.reference, *spec.body->robot, row);
  if (keeps(row, overrides)) save_recording(rollout.recording, trajectory_path(overrides.trajectories, row));
}

void Experiment::simulate(const EpisodeSpec& spec, const EpisodeOverrides& overrides, EpisodeRow& row) const {
  const std::unique_ptr<Policy> policy = policy_of(spec, overrides);
  RolloutSetup setup = this->setup(spec);
  if (overrides.stop_asked) setup.stop_asked = overrides.stop_asked;
  if (overrides.partner) *overrides.partner = episode_partner(setup).joints;
  setup.driven_partner = overrides.partner;
  const Rollout rollout = overrides.world ? overrides.world(setup, *policy) : executed(spec, setup, *policy, row);
  if (rollout.interrupted) throw EpisodeInterrupted();
  if (const PolicyFaults& faults = rollout.policy_faults; faults.dead) {
    row.policy_faults = faults;
    throw std::runtime_error(faults.message);
  }
  ScoringRules rules = rules_;
  rules.feet = setup.foot_trace;
  score_rollout(rollout, setup, rules, *spec.body->robot, row);
  if (!keeps(row, overrides)) return;
  save_episode_recording({rollout.recording, KeptEpisode{row, rules, act_source(rollout.recording, setup)}},
                         trajectory_path(overrides.trajectories, row));
}

EpisodeRow Experiment::run(const EpisodeSpec& spec, const EpisodeOverrides& overrides) const {
  EpisodeRow row = this->row(spec);
  if (!overrides.engine.empty()) {
    row.engine = overrides.engine;
    row.engine_version = "1";
    row.key = episode_key(row);
  }
  row.started_at = utc_now();
  if (const std::string lack = lack_of(spec); !lack.empty()) {
    row.robot_digest.clear();
    return ended_row(std::move(row), Outcome::kUnsupported, lack);
  }
  const double begin = monotonic_seconds();
  try {
    spec.reference != nullptr ? simulate_walk(spec, overrides, row) : simulate(spec, overrides, row);
  } catch (const StorageError&) {
    throw;
  } catch (const std::bad_alloc&) {
    throw;  // the machine's fault, not the policy's: no row says it
  } catch (const MissingError& error) {
    row = ended_row(std::move(row), Outcome::kUnsupported, error.what());
  } catch (const std::exception& error) {
    row = ended_row(std::move(row), Outcome::kError, error.what());
  }
  row.wall_s = monotonic_seconds() - begin;
  return row;
}

}  // namespace duet
