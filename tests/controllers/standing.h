// The G1 as it ships, and the reference of one that stands.
#pragma once

#include "duet/core/robot_state.h"
#include "duet/robots/robot_model.h"

namespace duet::test {

inline std::shared_ptr<const RobotModel> g1() {
  static const auto robot = load_shared_robot();
  return robot;
}

inline Reference standing_reference(double x = 0.0, double y = 0.0, double yaw = 0.0) {
  return {.X_WB = {yaw_rotation(yaw), {x, y, g1()->standing_height}}, .q = g1()->neutral};
}

}  // namespace duet::test
