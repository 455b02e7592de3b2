#include "duet/hardware/wire/odometry_source.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>

#include "duet/core/require.h"
#include "duet/robots/dynamics.h"

namespace duet {
namespace {

constexpr std::uint32_t kExternalVersion = 0x31504F44;  // "DOP1"
constexpr int kMostExternal = 32;                       // of a tick
constexpr double kUnit = 0.01;

struct ExternalBody {
  std::uint32_t version, valid;
  std::uint64_t sequence;
  double position[3], quat_wxyz[4], velocity[3];
  std::uint64_t reserved;
};
static_assert(sizeof(ExternalBody) == kExternalPoseBytes && std::endian::native == std::endian::little);

bool all_finite(const ExternalBody& body) {
  for (const double value : body.position)
    if (!std::isfinite(value)) return false;
  for (const double value : body.quat_wxyz)
    if (!std::isfinite(value)) return false;
  for (const double value : body.velocity)
    if (!std::isfinite(value)) return false;
  return true;
}

}  // namespace

void encode(const ExternalPose& pose, ExternalPoseBuffer& buffer) {
  const Eigen::Quaterniond& R = pose.X_WB.R;
  const Eigen::Vector3d& p = pose.X_WB.p;
  const Eigen::Vector3d& v = pose.v_WB;
  const ExternalBody body{kExternalVersion,
                          pose.valid ? 1u : 0u,
                          pose.sequence,
                          {p.x(), p.y(), p.z()},
                          {R.w(), R.x(), R.y(), R.z()},
                          {v.x(), v.y(), v.z()},
                          0};
  std::memcpy(buffer.data(), &body, sizeof(body));
}

bool decode(std::span<const std::byte> datagram, ExternalPose& pose) {
  ExternalBody body;
  if (datagram.size() != sizeof(body)) return false;
  std::memcpy(&body, datagram.data(), sizeof(body));
  const Eigen::Quaterniond R(body.quat_wxyz[0], body.quat_wxyz[1], body.quat_wxyz[2], body.quat_wxyz[3]);
  if (body.version != kExternalVersion || body.valid > 1 || !all_finite(body) || !(std::abs(R.norm() - 1.0) < kUnit))
    return false;
  pose.sequence = body.sequence;
  pose.X_WB = {R.normalized(), {body.position[0], body.position[1], body.position[2]}};
  pose.v_WB = {body.velocity[0], body.velocity[1], body.velocity[2]};
  pose.valid = body.valid == 1;
  return true;
}

bool ExternalOdometry::take(OdometrySample& sample) {
  std::array<std::byte, kExternalPoseBytes + 1> buffer;  // a longer one is refused
  ExternalPose pose;
  bool took = false;
  for (int k = 0; k < kMostExternal; ++k) {
    const std::size_t size = socket_.receive(buffer);
    if (size == 0) break;
    if (!decode(std::span<const std::byte>(buffer).first(size), pose)) {
      ++refused_;
      continue;
    }
    if (!order_.takes(pose.sequence, clock_())) continue;
    took = true;
    sample.sender_restarts = order_.restarts();
    sample.X_WB = pose.X_WB;
    sample.v_WB = pose.v_WB;
    sample.valid = pose.valid;
  }
  return took;
}

namespace {

// Found by trying on three walks in MuJoCo under WBC-Sim: softness 2, 10 mm; time 0.02, 0.05, 0.1, 0.2 s; slip 0.1,
// 0.2, 0.4 m/s. Longer times bear more slip and less error of the accelerometer.
constexpr double kSoleSoftness = 0.002;  // a sole's point so much higher than the lowest stands e times less [m]
constexpr double kPullTime = 0.05;       // in which the soles pull the speed to theirs [s]
constexpr double kSlip = 0.1;            // difference from the speed so far at which a sole pulls half as much [m/s]
// The share left of the pull of a sole that stands and disagrees altogether: after a stumble the speed comes back.
constexpr double kLeastTrust = 0.01;
constexpr double kLittleWeight = 0.05;  // of all soles, at which they pull half as much

const RobotModel& with_soles(const std::shared_ptr<const RobotModel>& robot) {
  require(robot != nullptr && !robot->feet.empty(), "leg odometry: expected a robot with soles, found none");
  return *robot;
}

}  // namespace

LegOdometry::LegOdometry(std::shared_ptr<const RobotModel> robot, double period)
    : robot_(std::move(robot)), period_(period), kinematics_(with_soles(robot_)) {
  require(period > 0.0, "leg odometry: expected a period above 0 s, found {}", period);
  soles_.resize(robot_->feet.size());
  jacobian_.setZero(3, 6 + robot_->dof());
  velocity_.setZero(6 + robot_->dof());
}

void LegOdometry::see(const LowStateFrame& frame) {
  if (read_state(frame, reading_) != FrameFault::kNone) return;
  const double periods = count_.periods_to(reading_.tick);
  Eigen::Vector3d force;
  for (int axis = 0; axis < 3; ++axis) {
    if (!std::isfinite(frame.imu.accelerometer[axis])) return;
    force[axis] = frame.imu.accelerometer[axis];
  }
  update(reading_.state, force, periods);
}

bool LegOdometry::take(OdometrySample& sample) {
  if (!new_) return false;
  new_ = false;
  sample = sample_;
  return true;
}

void LegOdometry::place_soles(const RobotState& state) {
  kinematics_.update({state.X_WB.R, Eigen::Vector3d::Zero()}, state.q);
  velocity_.segment<3>(3) = state.w_WB_B;
  velocity_.tail(robot_->dof()) = state.v;
  lowest_ = 0.0;
  for (std::size_t k = 0; k < soles_.size(); ++k) {
    const int shape = robot_->feet[k];
    Sole& sole = soles_[k];
    sole.p_BS_W = kinematics_.shape_position(shape) - robot_->shapes[shape].radius * Eigen::Vector3d::UnitZ();
    kinematics_.point_jacobian(robot_->shapes[shape].link, sole.p_BS_W, jacobian_);
    sole.v_WB.setZero();
    for (Eigen::Index column = 3; column < velocity_.size(); ++column)
      sole.v_WB -= velocity_[column] * jacobian_.col(column);
    lowest_ = std::min(lowest_, sole.p_BS_W.z());
  }
}

void LegOdometry::pull(double gain, bool robust) {
  double sum = 0.0;
  Eigen::Vector3d correction = Eigen::Vector3d::Zero();
  for (const Sole& sole : soles_) {
    const Eigen::Vector3d difference = sole.v_WB - sample_.v_WB;
    const double slip = difference.squaredNorm() / (kSlip * kSlip);
    const double trust = robust ? std::max(1.0 / (1.0 + slip * slip), kLeastTrust) : 1.0;
    const double weight = trust * std::exp(-(sole.p_BS_W.z() - lowest_) / kSoleSoftness);
    sum += weight;
    correction += weight * difference;
  }
  sample_.v_WB += gain * correction / (sum + (robust ? kLittleWeight : 0.0));
}

void LegOdometry::update(const RobotState& state, const Eigen::Vector3d& specific_force_B, double periods) {
  const double dt = periods * period_;
  place_soles(state);
  const Eigen::Vector3d before = sample_.v_WB;
  if (any_) {
    sample_.v_WB += dt * (state.X_WB.R * specific_force_B - kGravity * Eigen::Vector3d::UnitZ());
    pull(std::min(dt / kPullTime, 1.0), true);
    sample_.X_WB.p.head<2>() += 0.5 * dt * (before + sample_.v_WB).head<2>();
  } else {
    pull(1.0, false);
  }
  sample_.X_WB.R = state.X_WB.R;
  sample_.X_WB.p.z() = -lowest_;
  sample_.valid = true;
  any_ = new_ = true;
}

}  // namespace duet
