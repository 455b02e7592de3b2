#include "bench/rollout.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <deque>
#include <utility>

#include "backends/factory.h"
#include "bench/disturbance.h"
#include "core/clock.h"
#include "core/digest.h"
#include "core/require.h"
#include "policies/language.h"
#include "policies/observation_history.h"
#include "results/order_statistics.h"

namespace duet {
namespace {

using Clock = std::chrono::steady_clock;

void record_tick(Recording& recording, int tick, const Backend& backend, const HumanJoints& partner,
                 const Reference& reference, const JointCommand& command) {
  recording.robot.push_back(backend.state());
  recording.reference.push_back(reference);
  recording.q_target.push_back(command.q_target);
  if (!recording.partner.empty()) recording.partner.frame(tick) = partner;
  for (const Contact& contact : backend.contacts()) recording.contacts.push_back({tick, contact});
}

// What is measured at every physics step.
class StepMeter {
 public:
  StepMeter(const Backend& backend, const std::optional<ContactLimits>& limits) : backend_(backend) {
    const Scene& scene = backend.scene();
    if (scene.partner != PartnerMode::kSolid || !limits) return;
    ContactSafetyOptions options;
    options.link_radius = link_radii(*scene.robot);
    safety_.emplace(scene.human, *limits, scene.dt, options);
  }

  void add() {
    Eigen::Vector3d ground = Eigen::Vector3d::Zero();
    for (const Contact& contact : backend_.contacts())
      if (contact.side == ContactSide::kGround) ground += contact.f_W;
    ++steps_;
    ++steps_of_tick_;
    vertical_ += ground.z();
    tick_ += ground;
    if (safety_) safety_->add(backend_.contacts());
  }

  void end_tick() {
    if (steps_of_tick_ > 0) peak_ = std::max(peak_, tick_.norm() / steps_of_tick_);
    tick_.setZero();
    steps_of_tick_ = 0;
  }

  void finish(Rollout& rollout) const {
    rollout.ground = {steps_ > 0 ? vertical_ / static_cast<double>(steps_) : 0.0, peak_};
    if (safety_) rollout.safety = safety_->result();
  }

 private:
  const Backend& backend_;
  std::optional<ContactSafety> safety_;
  long steps_ = 0;
  int steps_of_tick_ = 0;
  double vertical_ = 0.0, peak_ = 0.0;
  Eigen::Vector3d tick_ = Eigen::Vector3d::Zero();  // sum over the steps of this tick
};

// Asks the policy for plans, takes the time of it, and hands each plan to the scheduler when its latency, which is
// simulated, is over. No plan is none: the scheduler then holds the last one.
class Planner {
 public:
  Planner(Policy& policy, double latency_ms)
      : policy_(policy), latency_ticks_(static_cast<int>(std::lround(latency_ms * kTickRate / 1000.0))) {}

  // Returns how long that took: a wait that is no part of the simulation.
  Clock::duration plan(const Observation& observation) {
    const Clock::time_point begin = Clock::now();
    std::vector<Reference> plan = policy_.plan(observation);
    const Clock::duration took = Clock::now() - begin;
    milliseconds_.push_back(std::chrono::duration<double, std::milli>(took).count());
    if (!plan.empty()) on_their_way_.push_back({observation.tick, std::move(plan)});
    dead_ = policy_.faults().dead;
    return took;
  }

  // Plans that have arrived by this tick.
  void deliver(int tick, Scheduler& scheduler) {
    while (!on_their_way_.empty() && on_their_way_.front().made + latency_ticks_ <= tick) {
      scheduler.push(std::move(on_their_way_.front().plan), on_their_way_.front().made);
      on_their_way_.pop_front();
    }
  }

  [[nodiscard]] bool dead() const { return dead_; }

  [[nodiscard]] PlanTimes times() const {
    return {quantile(milliseconds_, 0.5), quantile(milliseconds_, 0.95), quantile(milliseconds_, 1.0)};
  }

 private:
  struct SentPlan {
    int made;  // the tick of what the policy saw
    std::vector<Reference> plan;
  };

  Policy& policy_;
  int latency_ticks_;
  std::deque<SentPlan> on_their_way_;
  bool dead_ = false;
  std::vector<double> milliseconds_;
};

// Whether a rollout has to end though nothing happened in it: the wall-clock limit, or somebody asked.
class Deadline {
 public:
  explicit Deadline(const RolloutSetup& setup)
      : stop_asked_(setup.stop_asked),
        end_(Clock::now() +
             std::chrono::duration_cast<Clock::duration>(std::chrono::duration<double>(setup.wall_limit))) {}
  [[nodiscard]] bool stop_asked() const { return stop_asked_ && stop_asked_(); }
  [[nodiscard]] bool passed() const { return Clock::now() > end_; }
  void extend(Clock::duration time) { end_ += time; }

 private:
  const std::function<bool()>& stop_asked_;
  Clock::time_point end_;
};

// Steps between two looks at the clock within a control period: only a step far below the usual ones has so many.
constexpr int kStepsPerLook = 64;

Outcome advance(Backend& backend, const Disturbance& disturbance, int steps, StepMeter& meter,
                const Deadline& deadline) {
  for (int i = 0; i < steps; ++i) {
    if (i % kStepsPerLook == kStepsPerLook - 1 && (deadline.passed() || deadline.stop_asked()))
      return Outcome::kTimedOut;
    const Outcome outcome = backend.step(disturbance.in_effect(i));
    if (outcome != Outcome::kOk) return outcome;
    meter.add();
  }
  meter.end_tick();
  return has_fallen(backend.state()) ? Outcome::kFell : Outcome::kOk;
}

void trim(Recording& recording, int frames) {
  if (!recording.partner.empty() && frames < recording.partner.frames())
    recording.partner = recording.partner.slice(0, frames);
}

std::string describe(Outcome outcome, int tick, std::string_view engine) {
  switch (outcome) {
    case Outcome::kFell:
      return fmt::format("the robot fell at {:.2f} s", tick / kTickRate);
    case Outcome::kDiverged:
      return fmt::format("the state of {} diverged at {:.2f} s", engine, tick / kTickRate);
    case Outcome::kTimedOut:
      return fmt::format("the wall-clock limit passed at {:.2f} s of the episode", tick / kTickRate);
    default:
      return "";
  }
}

}  // namespace

bool has_fallen(const RobotState& state) {
  const double cos_tilt = (state.X_WB.R * Eigen::Vector3d::UnitZ()).z();
  return state.X_WB.p.z() < 0.45 || cos_tilt < 0.7;
}

int episode_ticks(const RolloutSetup& setup) {
  const int ticks = setup.reference.motion.frames();
  return setup.perturbation.partner ? episode_ticks(*setup.perturbation.partner, ticks) : ticks;
}

HumanMotion episode_partner(const RolloutSetup& setup) {
  return partner_motion(setup.clip->partner, setup.perturbation.partner, setup.reference.phases,
                        setup.reference.clip_frame, episode_ticks(setup) + 1);
}

HumanJoints partner_joints(const PointTracks& joints, int frame) {
  return joints.frame(std::clamp(frame, 0, joints.frames() - 1));
}

HumanJoints partner_velocities(const PointTracks& joints, int frame, double rate_hz) {
  return (partner_joints(joints, frame + 1) - partner_joints(joints, frame)) * rate_hz;
}

PointTracks partner_from_elsewhere(const PairedMotion& other, const AdaptedMotion& theirs, const AdaptedMotion& ours) {
  const Pose &from = theirs.motion.root.front(), &to = ours.motion.root.front();
  const Eigen::Quaterniond turn = yaw_rotation(yaw_of(to.R) - yaw_of(from.R));
  const Eigen::Vector3d level(1.0, 1.0, 0.0);
  const PointTracks& joints = other.partner.joints;
  PointTracks seen = joints.slice(std::min(theirs.clip_frame, joints.frames() - 1), joints.frames());
  for (int t = 0; t < seen.frames(); ++t)
    for (int j = 0; j < seen.points(); ++j)
      seen.at(t, j) = (turn * (seen.at(t, j) - from.p.cwiseProduct(level)) + to.p.cwiseProduct(level)).eval();
  return seen;
}

Rollout roll_out(const RolloutSetup& setup, Backend& backend, Controller& controller, Policy& policy) {
  const PointTracks people = episode_partner(setup).joints;
  const int ticks = episode_ticks(setup);
  const int steps_per_tick = static_cast<int>(std::lround(1.0 / (kTickRate * backend.scene().dt)));

  Rollout rollout;
  Recording& recording = rollout.recording;
  recording.task = setup.clip->task;
  recording.phases = setup.reference.phases;
  recording.partner = PointTracks(ticks, kSmplJoints);

  backend.reset(setup.start);
  controller.reset(setup.start);
  policy.reset({setup.clip->task, setup.prompt.empty() ? std::string(task_prompt(setup.clip->task)) : setup.prompt,
                setup.start, &setup.reference.motion, setup.seed, setup.stop_asked});
  Deadline deadline(setup);  // from here on: a program that starts is no part of the simulation
  Scheduler scheduler({.fuse_ticks = setup.fuse_ticks});
  scheduler.reset({setup.start.X_WB, setup.start.q});
  ObservationHistory history;
  Sha256 hash;
  JointCommand command = backend.scene().robot->default_command(setup.start.q);
  StepMeter meter(backend, setup.limits);
  Planner planner(policy, setup.perturbation.plan_latency_ms);
  Perception perception(setup.perturbation.perception, setup.perturbation_seed);
  Disturbance disturbance(setup.perturbation, *backend.scene().robot, setup.start, steps_per_tick, backend.scene().dt,
                          setup.perturbation_seed);

  int tick = 0;
  for (; tick < ticks && recording.outcome == Outcome::kOk; ++tick) {
    const HumanJoints partner = partner_joints(people, tick);
    const HumanJoints velocities = partner_velocities(people, tick, kTickRate);
    const bool own = setup.seen_partner.empty();
    history.add({perception.seen(tick, own ? partner : partner_joints(setup.seen_partner, tick)), backend.state()});
    if (tick % kTicksPerPlan == 0) deadline.extend(planner.plan(history.at(tick)));
    planner.deliver(tick, scheduler);
    if (planner.dead()) {
      recording.outcome = Outcome::kError;
      break;
    }
    const Reference& reference = scheduler.at(tick);
    controller.act(disturbance.seen(backend.state()), reference, command);
    disturbance.send(command);

    record_tick(recording, tick, backend, partner, reference, command);
    hash.update(backend.state());
    backend.set_partner(partner, velocities);
    backend.follow(reference);
    disturbance.push(tick, backend);
    recording.outcome = advance(backend, disturbance, steps_per_tick, meter, deadline);
    if (recording.outcome == Outcome::kOk && deadline.passed()) recording.outcome = Outcome::kTimedOut;
    if (deadline.stop_asked()) {
      rollout.interrupted = true;
      recording.outcome = Outcome::kTimedOut;
    }
  }
  meter.finish(rollout);
  trim(recording, tick);
  recording.message = describe(recording.outcome, tick, backend.name());
  rollout.late_plans = scheduler.late_ticks();
  rollout.policy_faults = policy.faults();
  if (planner.dead()) recording.message = rollout.policy_faults.message;
  rollout.plan_times = planner.times();
  rollout.faults = controller.faults();
  rollout.state_hash = hash.hex();
  return rollout;
}

Recording play_back(const RobotMotion& motion, const PointTracks& partner, Task task, const Phases& phases,
                    const std::shared_ptr<const RobotModel>& robot) {
  require(motion.frames() >= 2, fmt::format("playback needs 2 frames or more, found {}", motion.frames()));
  require(partner.empty() || partner.frames() == motion.frames(),
          fmt::format("playback: {} frames of the robot but {} of the partner", motion.frames(), partner.frames()));
  Scene scene;
  scene.robot = robot;
  scene.partner = PartnerMode::kNone;
  scene.dt = 1.0 / motion.rate_hz;
  const std::unique_ptr<Backend> backend = make_backend("playback", scene);

  Recording recording;
  recording.task = task;
  recording.phases = phases;
  recording.rate_hz = motion.rate_hz;
  recording.partner = partner;
  RobotState start = robot->standing_state(motion.root[0]);
  start.X_WB = motion.root[0];
  start.q = motion.q.col(0);
  backend->reset(start);
  const JointCommand command = robot->default_command(start.q);
  for (int t = 0; t < motion.frames(); ++t) {
    const Reference reference = motion.reference(t);
    if (t > 0) {
      backend->follow(reference);
      backend->step(command);
    }
    recording.robot.push_back(backend->state());
    recording.reference.push_back(reference);
    recording.q_target.push_back(reference.q);
  }
  return recording;
}

}  // namespace duet
