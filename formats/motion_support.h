// How far a robot's own body speaks for a motion: the limits of its joints, and soles that lie flat on the floor. It
// decides a fact that a file leaves open. Pure functions.
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <string>
#include <vector>

#include "duet/core/recording.h"
#include "duet/robots/robot_model.h"

namespace duet {

struct MotionSupport {
  double inside = 1.0;  // share of the angles within the card's limits, give or take 0.1 rad
  // Medians of the lower foot; not a number where the card has no soles.
  double sole = 0.0;  // its lowest point over the floor [m]
  double tilt = 0.0;  // of its sole against the floor [rad]

  // The number of things that speak against the motion, 0 to 3: angles outside the limits, soles off the floor, soles
  // that do not lie on it.
  [[nodiscard]] int doubts() const;
  [[nodiscard]] bool fits_limits() const;
  [[nodiscard]] std::string text() const;  // "within the limits 98.1 %, lower sole at -0.057 m, tilted by 12 degrees"
};

// The support of a motion in some of its frames. The motion has the robot's joints in its order.
MotionSupport support_of(const RobotModel& robot, const RobotMotion& motion);

// Share of the steps between frames in which a joint is quicker than its limit; joints without one are passed over.
double share_too_quick(const RobotModel& robot, const RobotMotion& motion);

// Where the links of a robot are and how they move, by our kinematics and finite differences: what tracking data sets
// keep beside the joint angles. Pure functions.

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
