#include "duet/policies/null_policy.h"

#include <utility>

#include "duet/core/require.h"

namespace duet {

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
