#include "duet/controllers/wbc_sim/leg_chain.h"

#include <Eigen/Cholesky>
#include <Eigen/Geometry>
#include <algorithm>

#include "duet/core/require.h"

namespace duet {
namespace {

using Vector6 = Eigen::Matrix<double, 6, 1>;
using Matrix6 = Eigen::Matrix<double, 6, 6>;

constexpr int kSteps = 3;           // at most
constexpr double kExact = 1e-9;     // error that is none [m]
constexpr double kDamping = 1e-4;   // of J^T J; keeps a stretched knee from turning over [m^2]
constexpr double kLongest = 0.3;    // step of one joint [rad]
constexpr double kRotation = 0.15;  // a radian of the foot's orientation weighs as much as this [m]

// The rotation vector that turns A into B, both seen from the base.
Eigen::Vector3d turn(const Eigen::Matrix3d& A, const Eigen::Matrix3d& B) {
  const Eigen::AngleAxisd difference(Eigen::Matrix3d(B * A.transpose()));
  return difference.angle() * difference.axis();
}

}  // namespace

LegChain::LegChain(const RobotModel& robot, const Leg& leg) : joints_(leg.joints) {
  require(leg.joints.size() == 6, "robot '{}': leg of '{}' has {} joints, expected 6", robot.name,
          robot.links[leg.link].name, leg.joints.size());
  for (const int joint : joints_) {
    const RobotLink& link = robot.links[joint + 1];
    hinges_.push_back({.R_PL0 = link.X_PL.R.toRotationMatrix(),
                       .p_PL = link.X_PL.p,
                       .axis = link.axis,
                       .lower = robot.joints[joint].lower,
                       .upper = robot.joints[joint].upper});
  }
}

LegChain::Placed LegChain::place(const Vector6& q) const {
  Placed placed;
  Eigen::Matrix3d R = Eigen::Matrix3d::Identity();
  Eigen::Vector3d p = Eigen::Vector3d::Zero();
  for (int i = 0; i < 6; ++i) {
    p += R * hinges_[i].p_PL;
    R = R * hinges_[i].R_PL0 * Eigen::AngleAxisd(q[i], hinges_[i].axis);
    placed.axes.col(i) = R * hinges_[i].axis;
    placed.origins.col(i) = p;
  }
  placed.R_BF = R;
  placed.p_BF = p;
  return placed;
}

Pose LegChain::foot_pose(const Vector6& q) const {
  const Placed placed = place(q);
  return {Eigen::Quaterniond(placed.R_BF), placed.p_BF};
}

void LegChain::solve(const Pose& X_BF, Vector6& q) const {
  const Eigen::Matrix3d R_BF = X_BF.R.toRotationMatrix();
  for (int step = 0; step < kSteps; ++step) {
    const Placed placed = place(q);
    Vector6 error;
    error << X_BF.p - placed.p_BF, kRotation * turn(placed.R_BF, R_BF);
    if (error.squaredNorm() < kExact * kExact) return;
    Matrix6 J;
    for (int i = 0; i < 6; ++i) {
      J.col(i).head<3>() = placed.axes.col(i).cross(placed.p_BF - placed.origins.col(i));
      J.col(i).tail<3>() = kRotation * placed.axes.col(i);
    }
    const Matrix6 normal = J.transpose() * J + kDamping * Matrix6::Identity();
    const Vector6 dq = normal.ldlt().solve(J.transpose() * error);
    for (int i = 0; i < 6; ++i)
      q[i] = std::clamp(q[i] + std::clamp(dq[i], -kLongest, kLongest), hinges_[i].lower, hinges_[i].upper);
  }
}

}  // namespace duet
