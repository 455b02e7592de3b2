// Legs of a robot from the poses of its base and of its soles: inverse kinematics by Newton's steps with damping,
// inside the joints' limits. One object a robot; const calls are thread-safe.
#pragma once

#include <Eigen/Geometry>
#include <array>
#include <vector>

#include "duet/core/pose.h"
#include "duet/robots/robot_model.h"

namespace duet {

class LegPose {
 public:
  // The robot must have legs and soles (make_upright_chain). It must outlive this.
  explicit LegPose(const RobotModel& robot);

  // Sets the joints of leg `side` (0 left, 1 right) in q (dof; also the guess) so that the middle of the sole lies at
  // X_WS, its axes as flat feet have them at q = 0. Returns how far the sole stays from there [m].
  double solve(int side, const Pose& X_WB, const Pose& X_WS, Eigen::VectorXd& q) const;

  // X_WS drawn towards the hip until a leg with a bent knee reaches it.
  Pose within_reach(int side, const Pose& X_WB, const Pose& X_WS) const;

  // In the base at q = 0 and for the neutral pose of what lies between base and leg.
  [[nodiscard]] const Eigen::Vector3d& hip(int side) const { return legs_[side].hip; }    // p_BHip
  [[nodiscard]] double length(int side) const { return legs_[side].length; }              // hip to ankle, straight [m]
  [[nodiscard]] double ankle_height(int side) const { return legs_[side].ankle_height; }  // over the sole [m]
  [[nodiscard]] const Eigen::Vector3d& sole(int side) const { return legs_[side].sole.p; }   // in the ankle's link
  [[nodiscard]] Pose sole_pose(int side, const Pose& X_WB, const Eigen::VectorXd& q) const;  // X_WS

 private:
  struct Leg {
    std::vector<int> path;    // links from the base's child to the foot
    std::vector<int> joints;  // of the robot that the leg may move
    Pose sole;                // X_LS in the foot's link: middle of the sole, flat
    Eigen::Vector3d hip = Eigen::Vector3d::Zero();
    double length = 0.0, ankle_height = 0.0;
  };
  struct Walk;
  void walk(const Leg& leg, const Pose& X_WB, const Eigen::VectorXd& q, Walk& out) const;

  const RobotModel& robot_;
  std::array<Leg, 2> legs_;
};

}  // namespace duet
