// Which joints carry the robot: the legs (chains from the base to a link with soles) and the rest, the upper body; and
// the Jacobians of the soles.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "duet/robots/kinematics.h"

namespace duet {

struct Leg {
  int link = 0;             // with the soles
  std::vector<int> joints;  // from the base to the link
};

class Stance {
 public:
  // Throws std::invalid_argument for a robot without soles or with soles at the base itself.
  explicit Stance(const RobotModel& robot);

  [[nodiscard]] const std::vector<Leg>& legs() const { return legs_; }
  [[nodiscard]] const std::vector<int>& upper() const { return upper_; }  // joints, ascending
  [[nodiscard]] int points() const { return static_cast<int>(feet_.size()); }

  // Soles' contact points, columns, on the lower side of their shapes. [m], frame W.
  void points_of(const Kinematics& kinematics, Eigen::Ref<Eigen::Matrix3Xd> p_W) const;
  // Stacked Jacobians of those points, (3 points) x (6 + dof).
  void jacobian_of(const Kinematics& kinematics, const Eigen::Matrix3Xd& p_W, Eigen::Ref<Eigen::MatrixXd> J) const;

 private:
  std::vector<int> feet_;  // shapes
  std::vector<Leg> legs_;
  std::vector<int> upper_;
};

}  // namespace duet
