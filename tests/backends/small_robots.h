// Robots small enough for closed forms, and commands for them.
#pragma once

#include <memory>

#include "duet/backends/backend.h"

namespace duet::test {

inline RobotLink box_link(const std::string& name, double mass) {
  RobotLink link;
  link.name = name;
  link.mass = mass;
  link.inertia = Eigen::Vector3d(0.4, 0.5, 0.6).asDiagonal();
  return link;
}

// A rigid body of 10 kg on four spheres, its origin 0.1 m over the ground. No joints.
inline std::shared_ptr<RobotModel> sledge() {
  auto robot = std::make_shared<RobotModel>();
  robot->name = "sledge";
  robot->links = {box_link("base", 10.0)};
  for (const double x : {-0.2, 0.2})
    for (const double y : {-0.2, 0.2}) {
      RobotShape foot;
      foot.X_LS.p = {x, y, -0.08};
      foot.radius = 0.02;
      foot.region = "foot";
      robot->feet.push_back(static_cast<int>(robot->shapes.size()));
      robot->shapes.push_back(foot);
    }
  robot->neutral = Eigen::VectorXd::Zero(0);
  robot->standing_height = 0.1;
  return robot;
}

// A wheel about z on a base so heavy that it does not move: the joint is alone. Wheel: 0.05 + 0.03 kg m^2 with
// armature.
inline constexpr double kWheelInertia = 0.05;
inline constexpr double kWheelArmature = 0.03;
inline std::shared_ptr<RobotModel> wheel() {
  auto robot = std::make_shared<RobotModel>();
  robot->name = "wheel";
  RobotLink base = box_link("base", 1e6);
  base.inertia *= 1e6;
  RobotLink rim = box_link("rim", 2.0);
  rim.parent = 0;
  rim.inertia = Eigen::Vector3d(0.03, 0.03, kWheelInertia).asDiagonal();
  robot->links = {base, rim};
  RobotJoint axle;
  axle.name = "axle";
  axle.lower = -1.0;
  axle.upper = 1.0;
  axle.effort = 10.0;
  axle.velocity = 50.0;
  axle.armature = kWheelArmature;
  robot->joints = {axle};
  robot->neutral = Eigen::VectorXd::Zero(1);
  return robot;
}

inline RobotState state_of(const RobotModel& robot, const Eigen::Vector3d& p_WB) {
  RobotState state;
  state.X_WB.p = p_WB;
  state.q = robot.neutral;
  state.v = Eigen::VectorXd::Zero(robot.dof());
  return state;
}

inline JointCommand no_torque(const RobotModel& robot) {
  const Eigen::VectorXd zero = Eigen::VectorXd::Zero(robot.dof());
  return {zero, zero, zero, zero};
}

// Equality of every bit that a state holds.
inline bool same(const RobotState& a, const RobotState& b) {
  return a.X_WB.p == b.X_WB.p && a.X_WB.R.coeffs() == b.X_WB.R.coeffs() && a.v_WB == b.v_WB && a.w_WB_B == b.w_WB_B &&
         a.q == b.q && a.v == b.v;
}

}  // namespace duet::test
