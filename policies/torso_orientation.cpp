#include "duet/policies/torso_orientation.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <utility>

namespace duet {
namespace {

// Whether a leg hangs on the link: its waist is below the trunk.
bool carries_legs(const RobotModel& robot, int link) {
  if (link == 0) return false;
  for (const std::vector<int>& leg : robot.roles.legs)
    for (int above = leg.empty() ? 0 : leg.front() + 1; above > 0; above = robot.links[above].parent)
      if (above == link) return true;
  return false;
}

Eigen::Vector3d rotation_vector(const Eigen::Quaterniond& R) {
  const Eigen::AngleAxisd turn(R.w() < 0.0 ? Eigen::Quaterniond(-R.coeffs()) : R);
  return turn.angle() * turn.axis();
}

}  // namespace

TorsoOrientation::TorsoOrientation(const RobotModel& robot) {
  const std::vector<int>& waist = robot.roles.waist;
  const int last = waist.empty() ? 0 : *std::ranges::max_element(waist) + 1;
  for (int link = last; link > 0; link = robot.links[static_cast<std::size_t>(link)].parent) {
    const RobotLink& moved = robot.links[static_cast<std::size_t>(link)];
    const RobotJoint& joint = robot.joints[static_cast<std::size_t>(link) - 1];
    const bool free = std::ranges::find(waist, link - 1) != waist.end();
    chain_.push_back({moved.X_PL.R, moved.axis, link - 1, free, joint.lower, joint.upper});
  }
  if (carries_legs(robot, last))
    turn_round();
  else
    std::ranges::reverse(chain_);
}

// From the link up to the base: each hinge turns the other way, and its place in the parent comes after it.
void TorsoOrientation::turn_round() {
  Eigen::Quaterniond R_before = Eigen::Quaterniond::Identity();
  for (Hinge& hinge : chain_) {
    const Eigen::Quaterniond R_after = hinge.R_before.conjugate();
    hinge.R_before = R_before;
    hinge.axis = -hinge.axis;
    R_before = R_after;
  }
  R_end_ = R_before;
}

Eigen::Quaterniond TorsoOrientation::at(const Eigen::VectorXd& q) const {
  Eigen::Quaterniond R = Eigen::Quaterniond::Identity();
  for (const Hinge& hinge : chain_) R = R * hinge.R_before * Eigen::AngleAxisd(q[hinge.joint], hinge.axis);
  return R * R_end_;
}

// Gauss-Newton on the rotation that is missing; a joint that a limit stops is left out of the step.
void TorsoOrientation::solve(const Eigen::Quaterniond& R_PT, Eigen::VectorXd& q) const {
  if (chain_.empty()) return;
  constexpr int kIterations = 30;
  constexpr double kDone = 1e-12, kDamping = 1e-9;  // [rad]; damping keeps a singular waist's step finite
  const auto size = static_cast<Eigen::Index>(chain_.size());
  Eigen::Matrix3Xd axes(3, size);
  for (int iteration = 0; iteration < kIterations; ++iteration) {
    Eigen::Quaterniond R = Eigen::Quaterniond::Identity();
    for (Eigen::Index i = 0; i < size; ++i) {
      const Hinge& hinge = chain_[static_cast<std::size_t>(i)];
      R = R * hinge.R_before;
      axes.col(i) = R * hinge.axis;
      R = R * Eigen::AngleAxisd(q[hinge.joint], hinge.axis);
    }
    const Eigen::Vector3d missing = rotation_vector(R_PT * (R * R_end_).conjugate());
    for (Eigen::Index i = 0; i < size; ++i) {
      const Hinge& hinge = chain_[static_cast<std::size_t>(i)];
      const double wish = axes.col(i).dot(missing), angle = q[hinge.joint];
      const bool stopped = (angle <= hinge.lower && wish < 0.0) || (angle >= hinge.upper && wish > 0.0);
      if (!hinge.waist || stopped) axes.col(i).setZero();
    }
    Eigen::MatrixXd normal = axes.transpose() * axes;
    normal.diagonal().array() += kDamping;
    const Eigen::VectorXd step = normal.ldlt().solve(axes.transpose() * missing);
    double moved = 0.0;
    for (Eigen::Index i = 0; i < size; ++i) {
      const Hinge& hinge = chain_[static_cast<std::size_t>(i)];
      if (!hinge.waist) continue;
      const double before =
          std::exchange(q[hinge.joint], std::clamp(q[hinge.joint] + step[i], hinge.lower, hinge.upper));
      moved = std::max(moved, std::abs(q[hinge.joint] - before));
    }
    if (moved < kDone) return;
  }
}

}  // namespace duet
