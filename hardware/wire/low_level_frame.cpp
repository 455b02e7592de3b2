#include "duet/hardware/wire/low_level_frame.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>

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
  if (reading.any && frame.tick == reading.tick && frame.crc == reading.checksum) return FrameFault::kRepeated;
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
  reading.checksum = frame.crc;
  reading.mode_pr = frame.mode_pr;
  reading.mode_machine = frame.mode_machine;
  reading.any = true;
  return FrameFault::kNone;
}

namespace {

constexpr std::uint32_t kPolynomial = 0x04C11DB7u;
constexpr std::uint32_t kFirst = 0xFFFFFFFFu;
constexpr std::uint32_t kTopBit = 0x80000000u;

constexpr std::uint32_t shifted(std::uint32_t crc) { return (crc << 1) ^ ((crc & kTopBit) != 0 ? kPolynomial : 0u); }

constexpr std::array<std::uint32_t, 256> kTable = [] {
  std::array<std::uint32_t, 256> table{};
  for (std::uint32_t byte = 0; byte < 256; ++byte) {
    std::uint32_t crc = byte << 24;
    for (int bit = 0; bit < 8; ++bit) crc = shifted(crc);
    table[byte] = crc;
  }
  return table;
}();

}  // namespace

std::uint32_t frame_checksum(std::span<const std::uint32_t> words) {
  std::uint32_t crc = kFirst;
  for (const std::uint32_t word : words)
    for (int shift = 24; shift >= 0; shift -= 8) crc = (crc << 8) ^ kTable[(crc >> 24) ^ ((word >> shift) & 0xFFu)];
  return crc;
}

std::uint32_t frame_checksum_by_bits(std::span<const std::uint32_t> words) {
  std::uint32_t crc = kFirst;
  for (const std::uint32_t word : words)
    for (int bit = 31; bit >= 0; --bit) crc = shifted(crc ^ (((word >> bit) & 1u) << 31));
  return crc;
}

namespace {

// Places in the 40 bytes; the first two are a head that is never 0.
constexpr int kKeysAt = 2, kLxAt = 4, kRxAt = 8, kRyAt = 12, kLyAt = 20;
constexpr std::uint8_t kHeadBytes[2] = {0x55, 0x51};

template <typename T>
T value_at(std::span<const std::uint8_t, kRemoteBytes> bytes, int at) {
  T value;
  std::memcpy(&value, bytes.data() + at, sizeof(T));
  return value;
}

template <typename T>
void put_at(std::span<std::uint8_t, kRemoteBytes> bytes, int at, T value) {
  std::memcpy(bytes.data() + at, &value, sizeof(T));
}

}  // namespace

bool RemoteControl::asks_to_stop() const {
  return holds(RemoteKey::kSelect) || (holds(RemoteKey::kL2) && holds(RemoteKey::kB));
}

RemoteControl read_remote(std::span<const std::uint8_t, kRemoteBytes> bytes) {
  return {.keys = value_at<std::uint16_t>(bytes, kKeysAt),
          .lx = value_at<float>(bytes, kLxAt),
          .ly = value_at<float>(bytes, kLyAt),
          .rx = value_at<float>(bytes, kRxAt),
          .ry = value_at<float>(bytes, kRyAt),
          .heard = std::ranges::any_of(bytes, [](std::uint8_t byte) { return byte != 0; })};
}

void write_remote(const RemoteControl& remote, std::span<std::uint8_t, kRemoteBytes> bytes) {
  std::ranges::fill(bytes, std::uint8_t{0});
  if (!remote.heard) return;
  std::ranges::copy(kHeadBytes, bytes.begin());
  put_at(bytes, kKeysAt, remote.keys);
  put_at(bytes, kLxAt, remote.lx);
  put_at(bytes, kLyAt, remote.ly);
  put_at(bytes, kRxAt, remote.rx);
  put_at(bytes, kRyAt, remote.ry);
}

}  // namespace duet
