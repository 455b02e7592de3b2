// Ankle feedback on the centre of mass, so that a robot under plain PD stands. Internal to backends/conformance.
#pragma once

#include "duet/robots/kinematics.h"

namespace duet::conformance {

class AnkleBalance {
 public:
  // Keeps a reference. The legs of its card have two joints or more, the last two are the ankle's.
  explicit AnkleBalance(const RobotModel& robot);
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
