#include "duet/hardware/low_level_frame.h"

#include <algorithm>
#include <cmath>
#include <cstring>

#include "duet/hardware/frame_checksum.h"

namespace duet {
namespace {

void begin(std::uint8_t mode_machine, LowCommandFrame& frame) {
  std::memset(&frame, 0, sizeof(frame));
  frame.mode_pr = kPitchRollMode;
  frame.mode_machine = mode_machine;
}

bool is_finite(const LowStateFrame& frame) {
  const auto all_finite = [](const auto& values) {
    return std::ranges::all_of(values, [](float value) { return std::isfinite(value); });
  };
  if (!all_finite(frame.imu.quaternion) || !all_finite(frame.imu.gyroscope)) return false;
  return std::all_of(frame.motor, frame.motor + kG1Motors, [](const MotorStateFrame& motor) {
    return std::isfinite(motor.q) && std::isfinite(motor.dq) && std::isfinite(motor.tau_est);
  });
}

Eigen::Quaterniond orientation(const ImuFrame& imu) {
  const Eigen::Quaterniond R(imu.quaternion[0], imu.quaternion[1], imu.quaternion[2], imu.quaternion[3]);
  return R.norm() > 0.5 ? R.normalized() : Eigen::Quaterniond(0.0, 1.0, 0.0, 0.0);  // upside down: it is not known
}

void read_health(const LowStateFrame& frame, const RobotState& state, RobotHealth& health) {
  const double upright = (state.X_WB.R * Eigen::Vector3d::UnitZ()).z();
  health.tilt = std::acos(std::clamp(upright, -1.0, 1.0));
  health.joint_speed = state.v.lpNorm<Eigen::Infinity>();
  health.gyro = state.w_WB_B.norm();
  health.casing = health.winding = -300.0;
  health.motor_error = false;
  for (int j = 0; j < kG1Motors; ++j) {
    health.casing = std::max(health.casing, static_cast<double>(frame.motor[j].temperature[0]));
    health.winding = std::max(health.winding, static_cast<double>(frame.motor[j].temperature[1]));
    health.motor_error = health.motor_error || frame.motor[j].motorstate != 0;
  }
}

}  // namespace

void build_command(const JointCommand& command, std::uint8_t mode_machine, LowCommandFrame& frame) {
  begin(mode_machine, frame);
  for (int j = 0; j < kG1Motors; ++j) {
    MotorCommandFrame& motor = frame.motor[j];
    motor.mode = 1;
    motor.q = static_cast<float>(command.q_target[j]);
    motor.tau = static_cast<float>(command.tau_ff[j]);
    motor.kp = static_cast<float>(command.kp[j]);
    motor.kd = static_cast<float>(command.kd[j]);
  }
  frame.crc = checksum_of(frame);
}

void build_damping(double kd, std::uint8_t mode_machine, LowCommandFrame& frame) {
  begin(mode_machine, frame);
  for (int j = 0; j < kG1Motors; ++j) {
    frame.motor[j].mode = 1;
    frame.motor[j].kd = static_cast<float>(kd);
  }
  frame.crc = checksum_of(frame);
}

void seal(LowStateFrame& frame) { frame.crc = checksum_of(frame); }

RobotReading::RobotReading() {
  state.q.setZero(kG1Motors);
  state.v.setZero(kG1Motors);
  tau.setZero(kG1Motors);
}

FrameFault read_state(const LowStateFrame& frame, RobotReading& reading) {
  if (frame.crc != checksum_of(frame)) return FrameFault::kChecksum;
  // The robot counts on past 2^32.
  if (reading.any && static_cast<std::int32_t>(frame.tick - reading.tick) <= 0) return FrameFault::kTick;
  if (!is_finite(frame)) return FrameFault::kNotFinite;
  RobotState& state = reading.state;
  state.X_WB.R = orientation(frame.imu);
  for (int axis = 0; axis < 3; ++axis) state.w_WB_B[axis] = frame.imu.gyroscope[axis];
  for (int j = 0; j < kG1Motors; ++j) {
    state.q[j] = frame.motor[j].q;
    state.v[j] = frame.motor[j].dq;
    reading.tau[j] = frame.motor[j].tau_est;
  }
  read_health(frame, state, reading.health);
  reading.remote = read_remote(frame.wireless_remote);
  reading.tick = frame.tick;
  reading.mode_pr = frame.mode_pr;
  reading.mode_machine = frame.mode_machine;
  reading.any = true;
  return FrameFault::kNone;
}

}  // namespace duet
