// Robot state, 36-D reference and joint command: the three values that pass between backend, controller and policy.
// Joint vectors have one entry per joint of the robot card, in its order (for the G1: Unitree's motor order 0..28).
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <cmath>

namespace duet {

// A rigid transform X_AB: pose of frame B in frame A. Monogram notation: X_AC = X_AB * X_BC.

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

struct RobotState {
  Pose X_WB;                                       // base link (pelvis)
  Eigen::Vector3d v_WB = Eigen::Vector3d::Zero();  // velocity of B's origin, in W [m/s]
  Eigen::Vector3d w_WB_B =
      Eigen::Vector3d::Zero();  // angular velocity of B in W, expressed in B (a gyro's reading) [rad/s]
  Eigen::VectorXd q;            // [rad]
  Eigen::VectorXd v;            // [rad/s]
};

// The policy's 36-D reference u_t of supplement A.4.1: 29 joint targets, root translation and unit quaternion.
struct Reference {
  Pose X_WB;
  Eigen::VectorXd q;  // [rad]
};

// Torque at every physics step: clamp(kp (q_target - q) - kd v + tau_ff, +-effort). docs/architecture.md, 3.
struct JointCommand {
  Eigen::VectorXd q_target;  // [rad]
  Eigen::VectorXd kp;        // [N m / rad], >= 0
  Eigen::VectorXd kd;        // [N m s / rad], >= 0
  Eigen::VectorXd tau_ff;    // [N m]
};

// The clock that controllers are called at and motions are stored at: 50 Hz (supplement A.1.1, F). A tick is one
// period.

inline constexpr double kTickRate = 50.0;  // [Hz]
inline constexpr double kTick = 0.02;      // [s]

inline int ticks_of(double seconds) { return static_cast<int>(std::lround(seconds * kTickRate)); }

// Contacts of the robot with the ground, the human partner and itself, in one sign convention for every engine.

enum class ContactSide { kGround, kHuman, kRobot };

struct Contact {
  int link = -1;                                   // robot link that is touched (index in RobotModel::links)
  ContactSide side = ContactSide::kGround;         // what touches it
  int other = -1;                                  // capsule of the human or link of the robot; -1 for the ground
  Eigen::Vector3d p_WC = Eigen::Vector3d::Zero();  // contact point [m]
  Eigen::Vector3d f_W =
      Eigen::Vector3d::Zero();  // force of the other side on the link, mean over the last step, at C [N]
  double depth = 0.0;           // penetration, >= 0 [m]
};

}  // namespace duet
