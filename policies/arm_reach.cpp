#include "duet/policies/arm_reach.h"

#include <Eigen/Dense>
#include <algorithm>
#include <limits>
#include <utility>

#include "duet/core/require.h"
#include "duet/robots/roles.h"

namespace duet {

ArmReach::ArmReach(std::shared_ptr<const RobotModel> robot, std::string_view policy)
    : robot_(std::move(robot)), kinematics_(*robot_), J_(3, 6 + robot_->dof()) {
  require(!robot_->roles.arms[0].empty() && !robot_->roles.arms[1].empty(),
          "policy '{}': robot '{}' has no arms in its card (roles.arms)", policy, robot_->name);
  kinematics_.update({}, robot_->neutral);
  for (const int side : {0, 1}) {
    shoulder_B_[side] = kinematics_.frame_position(robot_->track_frame(side == 0 ? "lshoulder" : "rshoulder"));
    length_[side] = arm_length(*robot_, side);
  }
}

int ArmReach::hand_frame(int side) const { return robot_->track_frame(side == 0 ? "lhand" : "rhand"); }

Eigen::Vector3d ArmReach::shoulder(int side, const Eigen::VectorXd& q) {
  kinematics_.update({}, q);
  return kinematics_.frame_position(robot_->track_frame(side == 0 ? "lshoulder" : "rshoulder"));
}

Eigen::Vector3d ArmReach::hand(int side, const Eigen::VectorXd& q) {
  kinematics_.update({}, q);
  return kinematics_.frame_position(hand_frame(side));
}

Eigen::Vector3d ArmReach::head() {
  kinematics_.update({}, robot_->neutral);
  return kinematics_.frame_position(robot_->track_frame("head"));
}

Eigen::VectorXd ArmReach::reached(int side, const Eigen::Vector3d& p_B) {
  Eigen::VectorXd q = robot_->neutral;
  reach(side, p_B, 80, q);
  return q;
}

void ArmReach::stretch(int side, const Eigen::Vector3d& from_shoulder, bool before, Eigen::VectorXd& q) {
  const double distance = std::max(from_shoulder.norm(), 1e-6);
  Eigen::Vector3d target = shoulder_B_[side] + from_shoulder * std::min(1.0, length_[side] / distance);
  if (before) target.x() = std::max(target.x(), 0.2 * length_[side]);
  reach(side, target, 8, q);
}

void ArmReach::reach(int side, const Eigen::Vector3d& p_B, int steps, Eigen::VectorXd& q) {
  const std::vector<int>& joints = robot_->roles.arms[side];
  const int frame = hand_frame(side);
  const int link = robot_->frames[frame].link;
  constexpr double kDamping = 0.05, kStep = 0.1;  // [m]; radians follow from the arm's metres
  for (int step = 0; step < steps; ++step) {
    kinematics_.update({}, q);
    const Eigen::Vector3d hand = kinematics_.frame_position(frame);
    Eigen::Vector3d error = p_B - hand;
    if (error.norm() > kStep) error *= kStep / error.norm();
    kinematics_.point_jacobian(link, hand, J_);
    Eigen::Matrix3d A = kDamping * kDamping * Eigen::Matrix3d::Identity();
    for (const int joint : joints) A += J_.col(6 + joint) * J_.col(6 + joint).transpose();
    const Eigen::Vector3d force = A.ldlt().solve(error);
    for (const int joint : joints)
      q[joint] =
          std::clamp(q[joint] + J_.col(6 + joint).dot(force), robot_->joints[joint].lower, robot_->joints[joint].upper);
  }
}

void HandWatch::reset() {
  height.fill(0.0);
  ahead.fill(0.0);
  lowest.fill(std::numeric_limits<double>::infinity());
  least_ahead = lowest;
}

void HandWatch::look(const ObservationFrame& frame) {
  Eigen::Vector3d to_robot = frame.robot.X_WB.p - frame.partner.col(0);
  to_robot.z() = 0.0;
  to_robot.normalize();
  for (const auto& [side, hand] : {std::pair{0, kLeftHand}, {1, kRightHand}}) {
    height[side] = frame.partner(2, hand) - frame.partner(2, 0);
    lowest[side] = std::min(lowest[side], height[side]);
    ahead[side] = to_robot.dot(frame.partner.col(hand) - frame.partner.col(0));
    least_ahead[side] = std::min(least_ahead[side], ahead[side]);
  }
}

}  // namespace duet
