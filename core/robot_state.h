// Robot state, 36-D reference and joint command: the three values that pass between backend, controller and policy.
// Joint vectors have one entry per joint of the robot card, in its order (for the G1: Unitree's motor order 0..28).
#pragma once

#include <Eigen/Core>

#include "duet/core/pose.h"

namespace duet {

struct RobotState {
  Pose X_WB;                                       // base link (pelvis)
  Eigen::Vector3d v_WB = Eigen::Vector3d::Zero();  // velocity of B's origin, in W [m/s]
  Eigen::Vector3d w_WB_B =
      Eigen::Vector3d::Zero();  // angular velocity of B in W, expressed in B (a gyro's reading) [rad/s]
  Eigen::VectorXd q;            // [rad]
  Eigen::VectorXd v;            // [rad/s]
};

// The policy's 36-D reference u_t of supplement A.4.1: 29 joint targets, root translation and unit quaternion.
struct Reference {
  Pose X_WB;
  Eigen::VectorXd q;  // [rad]
};

// Torque at every physics step: clamp(kp (q_target - q) - kd v + tau_ff, +-effort). docs/architecture.md, 3.
struct JointCommand {
  Eigen::VectorXd q_target;  // [rad]
  Eigen::VectorXd kp;        // [N m / rad], >= 0
  Eigen::VectorXd kd;        // [N m s / rad], >= 0
  Eigen::VectorXd tau_ff;    // [N m]
};

}  // namespace duet
