// Brings a hand of the robot to a place by the joints of its arm alone, and tells which hand the partner has raised:
// the parts of scripted controls and of corrections of a policy's reference. One owner, not thread-safe.
#pragma once

#include <Eigen/Core>
#include <array>
#include <memory>
#include <string_view>

#include "duet/policies/policy.h"
#include "duet/robots/kinematics.h"

namespace duet {

// Sides are 0 left, 1 right; places are in the base's frame [m]; `q` has all joints [rad].
class ArmReach {
 public:
  // `policy` is named in messages. Throws std::invalid_argument for a robot without arms (card: roles.arms, tracks).
  ArmReach(std::shared_ptr<const RobotModel> robot, std::string_view policy);

  [[nodiscard]] const Eigen::Vector3d& shoulder(int side) const { return shoulder_B_[side]; }  // in the neutral pose
  [[nodiscard]] double length(int side) const { return length_[side]; }                        // [m]
  [[nodiscard]] Eigen::Vector3d shoulder(int side, const Eigen::VectorXd& q);
  [[nodiscard]] Eigen::Vector3d hand(int side, const Eigen::VectorXd& q);
  // The head in the neutral pose.
  [[nodiscard]] Eigen::Vector3d head();
  // Moves the arm's joints in `q`, within their limits, so that its hand comes to `p_B`: `steps` steps of damped least
  // squares of at most 0.1 m each.
  void reach(int side, const Eigen::Vector3d& p_B, int steps, Eigen::VectorXd& q);
  // The same from the neutral pose, to the end.
  [[nodiscard]] Eigen::VectorXd reached(int side, const Eigen::Vector3d& p_B);
  // As `reach`, of a place seen from the shoulder: at most as far as the arm is long and, where asked for, before it.
  void stretch(int side, const Eigen::Vector3d& from_shoulder, bool before, Eigen::VectorXd& q);

 private:
  [[nodiscard]] int hand_frame(int side) const;

  std::shared_ptr<const RobotModel> robot_;  // shared with the policy
  Kinematics kinematics_;
  Eigen::MatrixXd J_;
  std::array<Eigen::Vector3d, 2> shoulder_B_;
  std::array<double, 2> length_ = {};
};

// How high each hand of the partner is over its root and how far from it towards the robot, level, and the least of
// both so far. [m]
struct HandWatch {
  std::array<double, 2> height = {}, lowest = {}, ahead = {}, least_ahead = {};

  HandWatch() { reset(); }
  void reset();
  void look(const ObservationFrame& frame);
  [[nodiscard]] double rise(int side) const { return height[side] - lowest[side]; }
  [[nodiscard]] double approach(int side) const { return ahead[side] - least_ahead[side]; }
};

}  // namespace duet
