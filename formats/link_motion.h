// Where the links of a robot are and how they move, by our kinematics and finite differences: what tracking data sets
// keep beside the joint angles. Pure functions.
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <vector>

#include "duet/core/robot_motion.h"
#include "duet/robots/robot_model.h"

namespace duet {

// The motion of the chosen links, B of them; one column is one frame. All in W.
struct LinkMotion {
  Eigen::MatrixXd position;          // (3 B, T) of the links' origins [m]
  Eigen::MatrixXd quat_wxyz;         // (4 B, T)
  Eigen::MatrixXd velocity;          // (3 B, T) of the links' origins [m/s]
  Eigen::MatrixXd angular_velocity;  // (3 B, T) [rad/s]
};

// `links`: indices in RobotModel::links. The motion has the robot's joints in its order and at least 2 frames.
LinkMotion link_motion(const RobotModel& robot, const RobotMotion& motion, const std::vector<int>& links);

// Central differences, one-sided at the ends (numpy.gradient, torch.gradient). `values`: (n, T), T >= 2.
Eigen::MatrixXd rate_of_change(const Eigen::MatrixXd& values, double rate_hz);

// The angular velocity of rotations R_WB, in W: the turn between the neighbours of a frame over the time between them;
// the ends as their neighbours (BeyondMimic's csv_to_npz). (3, T), T >= 2.
Eigen::MatrixXd angular_velocity(const std::vector<Eigen::Quaterniond>& R_WB, double rate_hz);

// Axis times angle of the shorter turn. [rad]
Eigen::Vector3d rotation_vector(const Eigen::Quaterniond& R);

}  // namespace duet
