#include "duet/hardware/safety/foot_load.h"

#include <Eigen/Dense>
#include <limits>

#include "duet/core/require.h"
#include "duet/robots/dynamics.h"
#include "duet/robots/roles.h"

namespace duet {
namespace {

constexpr int kLegJoints = 6;
constexpr double kStraight = 0.02;  // least singular value of a leg's Jacobian

const RobotModel& with_feet(const std::shared_ptr<const RobotModel>& robot) {
  require(robot != nullptr, "foot load: expected a robot, found none");
  const auto& legs = robot->roles.legs;
  require(legs[0].size() == kLegJoints && legs[1].size() == kLegJoints && soles_of_feet(*robot).size() == 2,
          "foot load: expected a robot of two legs with six joints and a sole each, found '{}'", robot->name);
  return *robot;
}

}  // namespace

FootLoad::FootLoad(std::shared_ptr<const RobotModel> robot)
    : robot_(std::move(robot)),
      kinematics_(with_feet(robot_)),
      linear_(3, 6 + robot_->dof()),
      angular_(3, 6 + robot_->dof()) {
  const std::vector<std::vector<int>> soles = soles_of_feet(*robot_);
  for (std::size_t side = 0; side < 2; ++side) feet_[side] = robot_->shapes[soles[side][0]].link;
}

std::array<std::optional<FootLoad::Wrench>, 2> FootLoad::wrenches(const Pose& X_WB, const Eigen::VectorXd& q,
                                                                  const Eigen::VectorXd& weight,
                                                                  const Eigen::VectorXd& tau) {
  kinematics_.update(X_WB, q);
  std::array<std::optional<Wrench>, 2> wrenches;
  for (std::size_t side = 0; side < 2; ++side) {
    const Eigen::Vector3d& p_W = kinematics_.p_WL(feet_[side]);
    kinematics_.point_jacobian(feet_[side], p_W, linear_);
    kinematics_.angular_jacobian(feet_[side], angular_);
    Eigen::Matrix<double, 6, 6> J;
    Wrench carried;
    for (int k = 0; k < kLegJoints; ++k) {
      const int joint = robot_->roles.legs[side][static_cast<std::size_t>(k)];
      J.col(k) << linear_.col(6 + joint), angular_.col(6 + joint);
      carried[k] = weight[6 + joint] - tau[joint];
    }
    const Eigen::JacobiSVD<Eigen::Matrix<double, 6, 6>> solver(J.transpose(),
                                                               Eigen::ComputeFullU | Eigen::ComputeFullV);
    if (solver.singularValues()[5] < kStraight) continue;
    Wrench wrench = solver.solve(carried);
    wrench.tail<3>() += p_W.cross(Eigen::Vector3d(wrench.head<3>()));
    wrenches[side] = wrench;
  }
  return wrenches;
}

double FootLoad::carried(const RobotState& state, const Eigen::VectorXd& weight, const Eigen::VectorXd& tau) {
  const auto [left, right] = wrenches(state.X_WB, state.q, weight, tau);
  if (!left || !right) return std::numeric_limits<double>::quiet_NaN();
  return ((*left)[2] + (*right)[2]) / (robot_->total_mass() * kGravity);
}

}  // namespace duet
