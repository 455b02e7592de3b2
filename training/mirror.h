// The robot's left-right symmetry: what an observation or an action would be in the mirrored situation. The joints
// of its card's legs and arms change places, and what turns about x or z changes sign.
#pragma once

#include <Eigen/Core>
#include <span>
#include <vector>

#include "duet/robots/robot_model.h"

namespace duet {

// y[i] = sign[i] x[from[i]].
struct Mirror {
  std::vector<int> from;
  std::vector<float> sign;

  void append(const Mirror& block, int offset);  // of a block that begins at `offset`
  void apply(std::span<const float> x, std::span<float> y) const;
  [[nodiscard]] int size() const { return static_cast<int>(from.size()); }
};

// Throws std::invalid_argument where a link has no counterpart.
Mirror mirror_joints(const RobotModel& robot);
Mirror mirror_actor(const RobotModel& robot);                                  // kOracle's observation
Mirror mirror_critic(const RobotModel& robot, const std::vector<int>& links);  // actor and bodies

}  // namespace duet
