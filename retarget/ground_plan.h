// Where the robot's base and soles go over a sequence, before PAIR moves anything above the legs: soles stand still
// where the person's feet do, the base follows the person slowly, upright, at a height from which the legs reach.
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <array>
#include <vector>

#include "duet/core/robot_state.h"
#include "duet/motion/human_motion.h"
#include "duet/retarget/pair_chain.h"
#include "duet/retarget/reshape.h"
#include "duet/robots/robot_model.h"

namespace duet {

// Legs of a robot from the poses of its base and of its soles: inverse kinematics by Newton's steps with damping,
// inside the joints' limits. One object a robot; const calls are thread-safe.
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

struct GroundPlan {
  Eigen::Matrix3Xd base;                 // p_WB, (3, T) [m]
  Eigen::VectorXd yaw;                   // of the base, smooth and unwrapped, (T) [rad]
  std::array<Eigen::Matrix3Xd, 2> sole;  // p_WS of each foot, (3, T) [m]
  std::array<Eigen::VectorXd, 2> turn;   // yaw of each sole, (T) [rad]
  FootStance stance;                     // of the robot: the person's, but for frames that its legs cannot reach
};

struct GroundPlanOptions {
  double smoothing = 0.2;   // standard deviation of the base's smoothing [s]
  double step_speed = 1.2;  // at most, mean over a step of a foot; slower ones take time from the stances [m/s]
};

// `reshaped` (T, 16, 3) with `tree`, at 50 Hz.
GroundPlan plan_ground(const RobotModel& robot, const LegPose& legs, const HumanMotion& source, const PairTree& tree,
                       const PointTracks& reshaped, const GroundPlanOptions& options);

}  // namespace duet
