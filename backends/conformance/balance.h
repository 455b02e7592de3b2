// Ankle feedback on the centre of mass, so that the G1 under plain PD stands. Internal to backends/conformance.
#pragma once

#include "robots/kinematics.h"

namespace duet::conformance {

class AnkleBalance {
 public:
  explicit AnkleBalance(const RobotModel& robot);  // keeps a reference
  // The card's gains about `q`, with stiffer ankles that are moved by the feedback of `state`; call it every kPeriod.
  static constexpr double kPeriod = 0.01;  // [s]
  JointCommand command(const RobotState& state, const Eigen::VectorXd& q);

 private:
  const RobotModel* robot_;
  Kinematics kinematics_;
  Eigen::MatrixXd jacobian_;
  std::vector<int> pitch_, roll_;  // joints of the ankles
};

}  // namespace duet::conformance
