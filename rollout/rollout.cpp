#include "duet/rollout/rollout.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "duet/core/digest.h"
#include "duet/core/require.h"
#include "duet/core/robot_state.h"
#include "duet/rollout/perturbations/perturbation.h"
#include "duet/rollout/world.h"
#include "duet/rollout/yielding_partner.h"

namespace duet {
namespace {

// Measures contacts at every physics step.
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

// Steps between two looks at the clock within a control period: only a step far below the usual ones has so many.
constexpr int kStepsPerLook = 64;

class PhysicsWorld final : public World {
 public:
  PhysicsWorld(const Episode& episode, Backend& backend, Controller& controller)
      : episode_(episode),
        backend_(backend),
        controller_(controller),
        steps_(steps_per_tick(backend.scene().dt)),
        steps_per_act_(steps_of_act(episode, backend.scene().dt, controller)),
        command_(backend.scene().robot->default_command(episode.start.q)),
        disturbance_(episode.perturbation, *backend.scene().robot, episode.start, steps_per_act_,
                     steps_ / steps_per_act_, backend.scene().dt, episode.perturbation_seed),
        meter_(backend, episode.limits) {
    if (!episode.partner_yields || backend.scene().partner != PartnerMode::kSolid) return;
    require(episode.restart == nullptr,
            "a partner who yields: expected an episode from its start, found one that is taken up again, which does "
            "not say how they moved");
    yielding_.emplace(backend.scene().human, backend.scene().dt);
  }

  void begin(const RobotState& start) override {
    tick_ = 0;
    controller_.reset(start);
    backend_.reset(episode_.restart == nullptr ? start : episode_.restart->start);
    if (yielding_) yielding_->reset();
  }
  [[nodiscard]] const RobotState& state() const override {
    return is_recorded() ? episode_.restart->recorded[static_cast<std::size_t>(tick_)] : backend_.state();
  }
  [[nodiscard]] std::span<const Contact> contacts() const override { return backend_.contacts(); }

  const Eigen::VectorXd& target(const Reference& reference) override {
    reference_ = &reference;
    act();
    return command_.q_target;
  }

  Outcome advance(int tick, const PointTracks& partner, Deadline& deadline) override {
    const bool was_recorded = is_recorded();
    tick_ = tick + 1;
    if (was_recorded) return Outcome::kOk;
    if (!partner.empty()) lead_partner(partner, tick);
    disturbance_.act(tick, backend_);
    const Outcome outcome = step_control_period(
        backend_, steps_,
        [this](int i) -> const JointCommand& {
          if (i > 0 && i % steps_per_act_ == 0) act();
          give_way();
          return disturbance_.in_effect(i % steps_per_act_);
        },
        [&](int i) {
          meter_.add();
          if (yielding_) yielding_->step(backend_.contacts());
          const bool look = (i + 1) % kStepsPerLook == kStepsPerLook - 1 && i + 1 < steps_;
          return !look || (!deadline.passed() && !deadline.stop_asked());
        });
    if (outcome != Outcome::kOk) return outcome;
    meter_.end_tick();
    if (yielding_ && yielding_->touched()) seen_ = partner_joints(partner, tick + 1) + yielding_->displacement();
    return has_fallen(backend_.state(), episode_.fall) ? Outcome::kFell : Outcome::kOk;
  }

  // Where a person is who gave way; before, and for everybody else, the episode says it.
  [[nodiscard]] const HumanJoints* seen_partner() const override {
    return yielding_ && yielding_->touched() ? &seen_ : nullptr;
  }
  [[nodiscard]] bool records_what_it_sees() const override { return true; }

  void finish(Rollout& rollout) const override {
    meter_.finish(rollout);
    rollout.faults = controller_.faults();
  }

 private:
  // Physics steps between two acts of the controller.
  static int steps_of_act(const Episode& episode, double dt, const Controller& controller) {
    const int steps = steps_per_tick(dt), acts = controller.acts_per_tick();
    require(steps % acts == 0,
            "controller '{}' acts {} times in a control period: expected a physics step that divides {} s, found {} s",
            controller.name(), acts, kTick / acts, dt);
    require(acts == 1 || episode.restart == nullptr,
            "controller '{}' acts {} times in a control period: its episodes cannot begin in the middle of one",
            controller.name(), acts);
    return steps / acts;
  }

  void act() {
    controller_.act(disturbance_.seen(state()), *reference_, command_);
    disturbance_.send(command_);
  }

  void lead_partner(const PointTracks& partner, int tick) {
    const HumanJoints joints = partner_joints(partner, tick), velocities = partner_velocities(partner, tick, kTickRate);
    if (yielding_) yielding_->lead(joints, velocities);
    if (!yielding_ || !yielding_->touched()) backend_.set_partner(joints, velocities);
  }
  // An untouched person goes on as a solid one, to the bit.
  void give_way() {
    if (yielding_ && yielding_->plan()) backend_.set_partner(yielding_->joints(), yielding_->velocities());
  }

  [[nodiscard]] bool is_recorded() const { return episode_.restart != nullptr && tick_ < episode_.restart->tick; }

  const Episode& episode_;
  Backend& backend_;
  Controller& controller_;
  int tick_ = 0;
  int steps_, steps_per_act_;
  const Reference* reference_ = nullptr;  // of the tick
  JointCommand command_;
  Disturbance disturbance_;
  StepMeter meter_;
  std::optional<YieldingPartner> yielding_;
  HumanJoints seen_ = HumanJoints::Zero();
};

// A world without physics: the robot is where its reference was a tick ago.
class KinematicWorld final : public World {
 public:
  explicit KinematicWorld(const Episode& episode) : episode_(episode) {}

  void begin(const RobotState& start) override { follower_ = KinematicFollower(start); }
  [[nodiscard]] const RobotState& state() const override { return follower_.state(); }
  const Eigen::VectorXd& target(const Reference& reference) override {
    reference_ = reference;
    return reference_.q;
  }
  Outcome advance(int, const PointTracks&, Deadline&) override {
    follower_.go_to(reference_, kTick);
    return has_fallen(follower_.state(), episode_.fall) ? Outcome::kFell : Outcome::kOk;
  }

 private:
  const Episode& episode_;
  Reference reference_;
  KinematicFollower follower_;
};

void record_tick(Recording& recording, int tick, const World& world, const HumanJoints* partner,
                 const Reference& reference, const Eigen::VectorXd& target) {
  recording.robot.push_back(world.state());
  recording.reference.push_back(reference);
  recording.q_target.push_back(target);
  if (partner != nullptr) recording.partner.frame(tick) = *partner;
  for (const Contact& contact : world.contacts()) recording.contacts.push_back({tick, contact});
}

}  // namespace

Rollout roll_out(const Episode& episode, World& world, ReferenceSource& source, std::string_view engine) {
  Rollout rollout;
  Recording& recording = rollout.recording;
  const PointTracks& others = episode.other_person();
  const bool somebody = !others.empty();
  if (somebody) recording.partner = PointTracks(episode.ticks, kSmplJoints);
  world.begin(episode.start);
  source.begin(episode.start);
  // From here on: a program that starts is not simulated.
  Deadline deadline(episode.wall_limit, episode.stop_asked, episode.clock);
  Sha256 hash;
  HumanJoints partner;

  int tick = 0;
  for (; tick < episode.ticks && recording.outcome == Outcome::kOk; ++tick) {
    if (somebody) partner = partner_joints(others, tick);
    const HumanJoints* seen = somebody ? world.seen_partner() : nullptr;
    if (seen != nullptr && world.records_what_it_sees()) partner = *seen;
    deadline.pause();  // a plan is the policy's, which has limits of its own
    const Reference* reference =
        source.at({tick, world.state(), seen != nullptr ? seen : (somebody ? &partner : nullptr)});
    deadline.go_on();
    if (reference == nullptr) {
      recording.outcome = Outcome::kError;
      break;
    }
    const Eigen::VectorXd& target = world.target(*reference);
    record_tick(recording, tick, world, somebody ? &partner : nullptr, *reference, target);
    hash.update(world.state());
    recording.outcome = world.advance(tick, others, deadline);
    if (recording.outcome == Outcome::kOk && deadline.passed()) recording.outcome = Outcome::kTimedOut;
    if (deadline.stop_asked()) {
      rollout.interrupted = true;
      recording.outcome = Outcome::kTimedOut;
    }
  }
  world.finish(rollout);
  trim(recording, tick);
  recording.message = world.message();
  if (recording.message.empty())
    recording.message =
        recording.outcome == Outcome::kError ? source.message() : describe(recording.outcome, tick, engine);
  rollout.state_hash = hash.hex();
  return rollout;
}

Rollout roll_out(const Episode& episode, Backend& backend, Controller& controller, ReferenceSource& source) {
  PhysicsWorld world(episode, backend, controller);
  return roll_out(episode, world, source, backend.name());
}

Rollout play_back(const Episode& episode, ReferenceSource& source) {
  KinematicWorld world(episode);
  return roll_out(episode, world, source, "playback");
}

HumanJoints partner_joints(const PointTracks& joints, int frame) {
  return joints.frame(std::clamp(frame, 0, joints.frames() - 1));
}

HumanJoints partner_velocities(const PointTracks& joints, int frame, double rate_hz) {
  return (partner_joints(joints, frame + 1) - partner_joints(joints, frame)) * rate_hz;
}

}  // namespace duet
