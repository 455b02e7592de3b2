#include "duet/policies/reference_policies.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "duet/core/require.h"
#include "duet/core/robot_state.h"

namespace duet {

ReplayPolicy::ReplayPolicy(std::shared_ptr<const RobotModel> robot) : robot_(std::move(robot)) {
  require(robot_ != nullptr, "policy 'replay' needs a robot");
}

void ReplayPolicy::reset(const EpisodeContext& context) {
  require(context.hindsight != nullptr, "policy 'replay' needs the episode's motion (EpisodeContext::hindsight)");
  const RobotMotion& motion = *context.hindsight;
  validate(motion, "policy 'replay'");
  require(motion.frames() > 0, "policy 'replay': expected a motion with frames, found none");
  require(motion.rate_hz == kTickRate, "policy 'replay': expected a motion at {} Hz, found {} Hz", kTickRate,
          motion.rate_hz);
  require(motion.joint_names == robot_->joint_names(),
          "policy 'replay': expected the {} joints of robot '{}' in its order, found {} others", robot_->dof(),
          robot_->name, motion.joint_names.size());
  motion_ = motion;
}

Reference ReplayPolicy::at(int tick) const {
  require(motion_.frames() > 0, "policy 'replay': reset comes first");
  return motion_.reference(std::clamp(tick, 0, motion_.frames() - 1));
}

Anchors ReplayPolicy::act(const Observation& observation) {
  Anchors anchors;
  for (int i = 0; i < kAnchors; ++i) anchors[static_cast<std::size_t>(i)] = at(observation.tick + i * kTicksPerAnchor);
  return anchors;
}

std::vector<Reference> DenseReplayPolicy::plan(const Observation& observation) {
  constexpr int kTicks = (kAnchors - 1) * kTicksPerAnchor;  // as densify
  std::vector<Reference> plan;
  plan.reserve(kTicks);
  for (int i = 0; i < kTicks; ++i) plan.push_back(at(observation.tick + i));
  return plan;
}

NullPolicy::NullPolicy(std::shared_ptr<const RobotModel> robot) : robot_(std::move(robot)) {
  require(robot_ != nullptr, "policy 'null' needs a robot");
  reset({});
}

void NullPolicy::reset(const EpisodeContext& context) {
  const RobotState standing = robot_->standing_state(context.start.X_WB);
  anchors_.fill({standing.X_WB, standing.q});
}

Anchors NullPolicy::act(const Observation&) { return anchors_; }

}  // namespace duet
