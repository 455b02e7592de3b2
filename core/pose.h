// A rigid transform X_AB: pose of frame B in frame A. Monogram notation: X_AC = X_AB * X_BC.
#pragma once

#include <Eigen/Geometry>

namespace duet {

struct Pose {
  Eigen::Quaterniond R = Eigen::Quaterniond::Identity();  // R_AB, unit
  Eigen::Vector3d p = Eigen::Vector3d::Zero();            // p_AB: origin of B from origin of A, in A [m]

  [[nodiscard]] Pose operator*(const Pose& X_BC) const { return {R * X_BC.R, p + R * X_BC.p}; }
  [[nodiscard]] Eigen::Vector3d operator*(const Eigen::Vector3d& p_B) const { return p + R * p_B; }
  [[nodiscard]] Pose inverse() const { return {R.conjugate(), -(R.conjugate() * p)}; }
};

// Linear in position, slerp (shorter arc) in rotation; s = 0 gives a, s = 1 gives b.
inline Pose interpolate(const Pose& a, const Pose& b, double s) { return {a.R.slerp(s, b.R), a.p + s * (b.p - a.p)}; }

// Heading of R_WB: the angle of B's x axis in the ground plane, in (-pi, pi] [rad].
inline double yaw_of(const Eigen::Quaterniond& R_WB) {
  const Eigen::Vector3d x_W = R_WB * Eigen::Vector3d::UnitX();
  return std::atan2(x_W.y(), x_W.x());
}

inline Eigen::Quaterniond yaw_rotation(double yaw) {
  return Eigen::Quaterniond(Eigen::AngleAxisd(yaw, Eigen::Vector3d::UnitZ()));
}

}  // namespace duet
