// Inverse kinematics of one leg: the joint angles that put its foot where it is wanted, by damped Gauss-Newton from the
// last solution. A fixed number of steps, no allocation: time and result depend on the input alone.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "duet/controllers/stance.h"
#include "duet/robots/robot_model.h"

namespace duet {

class LegChain {
 public:
  // Throws std::invalid_argument unless the leg has six joints.
  LegChain(const RobotModel& robot, const Leg& leg);

  [[nodiscard]] const std::vector<int>& joints() const { return joints_; }
  // Pose of the foot's link in the base for the leg's joint angles.
  [[nodiscard]] Pose foot_pose(const Eigen::Matrix<double, 6, 1>& q) const;
  // Moves `q`, the start, towards the angles that put the foot at X_BF; within the limits. A pose out of reach gives
  // angles near the nearest one.
  void solve(const Pose& X_BF, Eigen::Matrix<double, 6, 1>& q) const;

 private:
  struct Hinge {
    Eigen::Matrix3d R_PL0;
    Eigen::Vector3d p_PL, axis;
    double lower, upper;
  };
  struct Placed {
    Eigen::Matrix<double, 3, 6> axes, origins;  // in B
    Eigen::Matrix3d R_BF;
    Eigen::Vector3d p_BF;
  };
  [[nodiscard]] Placed place(const Eigen::Matrix<double, 6, 1>& q) const;

  std::vector<int> joints_;
  std::vector<Hinge> hinges_;
};

}  // namespace duet
