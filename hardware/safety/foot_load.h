// The floor's wrench on each foot of a robot, from the torques that its legs report: at rest g(q) = tau + J^T F. A
// robot that hangs is carried by none of them. Buffers are sized on construction. One owner, one thread.
#pragma once

#include <array>
#include <memory>
#include <optional>

#include "duet/core/robot_state.h"
#include "duet/robots/kinematics.h"
#include "duet/robots/robot_model.h"

namespace duet {

class FootLoad {
 public:
  using Wrench = Eigen::Matrix<double, 6, 1>;  // force, and moment about the base's origin; W

  // Throws std::invalid_argument for no robot, and one without two legs of six joints and their soles.
  explicit FootLoad(std::shared_ptr<const RobotModel> robot);

  // The floor's wrench on each foot, left and right; none where a knee is straight: nothing is known of a force along
  // that leg. `weight`: the generalized forces of gravity, of base and joints. `tau`: of the joints as measured [N m].
  std::array<std::optional<Wrench>, 2> wrenches(const Pose& X_WB, const Eigen::VectorXd& q,
                                                const Eigen::VectorXd& weight, const Eigen::VectorXd& tau);
  // The share of the robot's weight that both feet carry; NaN where a knee is straight. No allocation. A step's
  // accelerations count as load: right on average.
  double carried(const RobotState& state, const Eigen::VectorXd& weight, const Eigen::VectorXd& tau);

 private:
  std::shared_ptr<const RobotModel> robot_;
  std::array<int, 2> feet_{};
  Kinematics kinematics_;
  Eigen::MatrixXd linear_, angular_;
};

}  // namespace duet
