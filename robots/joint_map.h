// Joint vectors of one robot on another whose joints have the same names: joints that the other lacks are dropped,
// those that only the other has stay at neutral. Immutable.
#pragma once

#include <Eigen/Core>
#include <string>
#include <vector>

#include "duet/core/robot_motion.h"
#include "duet/core/robot_state.h"
#include "duet/robots/robot_model.h"

namespace duet {

class JointMap {
 public:
  // Throws std::invalid_argument where the two have joints, but none in common.
  JointMap(const std::vector<std::string>& from, const RobotModel& to);
  [[nodiscard]] Eigen::VectorXd positions(const Eigen::VectorXd& q) const { return fill(q, neutral_); }
  [[nodiscard]] Eigen::VectorXd rates(const Eigen::VectorXd& v) const;  // 0 where there is none
  [[nodiscard]] RobotState state(const RobotState& state) const;

 private:
  [[nodiscard]] Eigen::VectorXd fill(const Eigen::VectorXd& values, Eigen::VectorXd filled) const;

  Eigen::VectorXd neutral_;
  std::vector<int> source_;  // of each joint of `to`; -1 where `from` lacks it
};

// A motion on another robot. Throws as JointMap. With the same joints in the same order: the motion to the bit.
RobotMotion on_body(const RobotMotion& motion, const RobotModel& body);

}  // namespace duet
