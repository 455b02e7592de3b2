// The G1 on the ground, for the tests of what no small robot shows.
#pragma once

#include <algorithm>
#include <array>

#include "duet/backends/backend.h"
#include "duet/core/robot_state.h"
#include "duet/robots/robot_model.h"

namespace duet::test {

inline std::shared_ptr<const RobotModel> g1() { return load_shared_robot(); }

inline Scene g1_scene(PartnerMode partner = PartnerMode::kNone) {
  Scene scene;
  scene.robot = g1();
  scene.partner = partner;
  return scene;
}

// By how much a joint is beyond its limits, of all the most [rad].
inline double largest_violation(const RobotModel& robot, const RobotState& state) {
  double largest = 0.0;
  for (int i = 0; i < robot.dof(); ++i)
    largest = std::max({largest, robot.joints[i].lower - state.q[i], state.q[i] - robot.joints[i].upper});
  return largest;
}

}  // namespace duet::test
