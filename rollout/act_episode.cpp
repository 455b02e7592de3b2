#include "duet/rollout/act_episode.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <utility>

#include "duet/core/numbers.h"
#include "duet/core/robot_state.h"
#include "duet/metrics/interaction.h"
#include "duet/policies/language.h"

namespace duet {
namespace {

Episode episode_of(const RolloutSetup& setup) {
  return {setup, episode_ticks(setup), episode_partner(setup).joints, setup.driven_partner};
}

// The task's own command, where none is given; it says so where the robot has to begin.
std::string command_of(const RolloutSetup& setup) {
  if (!setup.prompt.empty()) return setup.prompt;
  const std::string_view prompt = task_prompt(setup.clip->task);
  const bool answers = partner_begins(setup.clip->task, setup.clip->partner.joints);
  return answers ? std::string(prompt) : leading_prompt(prompt);
}

PolicyReference reference_of(const RolloutSetup& setup, Policy& policy) {
  return {policy,
          {.context = {setup.clip->task, command_of(setup), setup.start, &setup.reference.motion, setup.seed,
                       setup.stop_asked},
           .seen_partner = setup.seen_partner,
           .perception = setup.perturbation.perception,
           .perception_seed = setup.perturbation_seed,
           .plan_latency_ms = setup.perturbation.plan_latency_ms,
           .fuse_ticks = setup.fuse_ticks,
           .max_root_speed = setup.max_root_speed}};
}

Rollout finished(Rollout rollout, const RolloutSetup& setup, const PolicyReference& reference) {
  rollout.recording.task = setup.clip->task;
  rollout.recording.phases = setup.reference.phases;
  reference.finish(rollout);
  return rollout;
}

}  // namespace

Rollout roll_out(const RolloutSetup& setup, Backend& backend, Controller& controller, Policy& policy) {
  PolicyReference reference = reference_of(setup, policy);
  return finished(roll_out(episode_of(setup), backend, controller, reference), setup, reference);
}

Rollout roll_out(const RolloutSetup& setup, World& world, Policy& policy, std::string_view engine) {
  PolicyReference reference = reference_of(setup, policy);
  return finished(roll_out(episode_of(setup), world, reference, engine), setup, reference);
}

Rollout play_back(const RolloutSetup& setup, Policy& policy) {
  PolicyReference reference = reference_of(setup, policy);
  return finished(play_back(episode_of(setup), reference), setup, reference);
}

int episode_ticks(const RolloutSetup& setup) {
  const int ticks = setup.reference.motion.frames();
  return setup.perturbation.partner ? episode_ticks(*setup.perturbation.partner, ticks) : ticks;
}

HumanMotion episode_partner(const RolloutSetup& setup) {
  return partner_motion(setup.clip->partner, setup.perturbation.partner, setup.reference.phases,
                        setup.reference.clip_frame, episode_ticks(setup) + 1);
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

PolicyReference::PolicyReference(Policy& policy, PolicyReferenceOptions options)
    : policy_(policy),
      options_(std::move(options)),
      latency_ticks_(ticks_of(options_.plan_latency_ms / 1000.0)),
      perception_(options_.perception, options_.perception_seed),
      scheduler_({.fuse_ticks = options_.fuse_ticks, .max_root_speed = options_.max_root_speed}) {}

void PolicyReference::begin(const RobotState& start) {
  options_.context.start = start;
  policy_.reset(options_.context);
  scheduler_.reset({start.X_WB, start.q});
}

const Reference* PolicyReference::at(const TickView& present) {
  look(present);
  if (present.tick % kTicksPerPlan == 0) plan(present.tick);
  if (policy_.faults().dead) return nullptr;
  deliver(present.tick);
  const Reference& fused = scheduler_.at(present.tick);
  if (!policy_.corrects()) return &fused;
  corrected_ = fused;
  policy_.correct(history_.at(present.tick), corrected_);
  return &corrected_;
}

void PolicyReference::look(const TickView& present) {
  const bool own = options_.seen_partner.empty();
  const HumanJoints partner = own ? *present.partner : partner_joints(options_.seen_partner, present.tick);
  history_.add({perception_.seen(present.tick, partner), present.robot});
}

// No plan is none: the scheduler then holds the last one.
void PolicyReference::plan(int tick) {
  const auto begin = std::chrono::steady_clock::now();
  std::vector<Reference> plan = policy_.plan(history_.at(tick));
  milliseconds_.push_back(std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - begin).count());
  if (!plan.empty()) on_their_way_.push_back({tick, std::move(plan)});
}

void PolicyReference::deliver(int tick) {
  while (!on_their_way_.empty() && on_their_way_.front().made + latency_ticks_ <= tick) {
    scheduler_.push(std::move(on_their_way_.front().plan), on_their_way_.front().made);
    on_their_way_.pop_front();
  }
}

void PolicyReference::finish(Rollout& rollout) const {
  rollout.late_plans = scheduler_.late_ticks();
  rollout.policy_faults = policy_.faults();
  rollout.plan_times = {quantile(milliseconds_, 0.5), quantile(milliseconds_, 0.95), quantile(milliseconds_, 1.0)};
}

}  // namespace duet
