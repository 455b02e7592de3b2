// Where the robot's base and soles go over a sequence, before PAIR moves anything above the legs: soles stand still
// where the person's feet do, the base follows the person slowly, upright, at a height from which the legs reach.
#pragma once

#include <Eigen/Core>
#include <array>
#include <vector>

#include "duet/core/pose.h"
#include "duet/motion/foot_contact.h"
#include "duet/retarget/leg_pose.h"
#include "duet/retarget/pair_chain.h"
#include "duet/retarget/reshape.h"

namespace duet {

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
