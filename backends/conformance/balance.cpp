#include "duet/backends/conformance/balance.h"

#include <algorithm>

#include "duet/robots/roles.h"

namespace duet::conformance {
namespace {

constexpr double kPendulumHeight = 0.65;              // of the centre of mass over the ankles [m]
constexpr double kPosition = 1.5, kSpeed = 0.35;      // ankle angle per angle of the pendulum [1], [s]
constexpr double kStiffness = 150.0, kDamping = 4.0;  // of the ankles; the card's 40 N m/rad do not hold the crouch
constexpr double kMostPitch = 0.3, kMostRoll = 0.2;   // [rad]

}  // namespace

AnkleBalance::AnkleBalance(const RobotModel& robot)
    : robot_(&robot), kinematics_(robot), jacobian_(Eigen::MatrixXd::Zero(3, 6 + robot.dof())) {
  for (const std::vector<int>& leg : robot.roles.legs)
    for (const int ankle : {leg[leg.size() - 2], leg.back()}) (is_roll(robot, ankle) ? roll_ : pitch_).push_back(ankle);
}

JointCommand AnkleBalance::command(const RobotState& state, const Eigen::VectorXd& q) {
  kinematics_.update(state.X_WB, state.q);
  Eigen::Vector3d feet = Eigen::Vector3d::Zero();
  for (const int foot : robot_->feet)
    feet += kinematics_.shape_position(foot) / static_cast<double>(robot_->feet.size());
  kinematics_.center_of_mass_jacobian(jacobian_);
  Eigen::VectorXd v(6 + robot_->dof());
  v << state.v_WB, state.w_WB_B, state.v;
  const Eigen::Vector3d lean = (kinematics_.center_of_mass() - feet) / kPendulumHeight;
  const Eigen::Vector3d rate = jacobian_ * v / kPendulumHeight;
  JointCommand command = robot_->default_command(q);
  for (const std::vector<int>& ankles : {pitch_, roll_})
    for (const int joint : ankles) {
      command.kp[joint] = kStiffness;
      command.kd[joint] = kDamping;
    }
  for (const int joint : pitch_)
    command.q_target[joint] += std::clamp(kPosition * lean.x() + kSpeed * rate.x(), -kMostPitch, kMostPitch);
  for (const int joint : roll_)
    command.q_target[joint] -= std::clamp(0.5 * (kPosition * lean.y() + kSpeed * rate.y()), -kMostRoll, kMostRoll);
  return command;
}

}  // namespace duet::conformance
