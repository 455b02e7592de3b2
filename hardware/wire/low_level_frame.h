// The G1's low-level messages as they lie in memory (little-endian, with the layout of a C struct; CDR's differs:
// hardware/log/frame_cdr.h), and how one is built: from zeros, because padding is inside the checksum. Facts:
// docs/hardware.md, "Wire". No allocation.
#pragma once

#include <array>
#include <bit>
#include <cstdint>
#include <cstring>
#include <span>
#include <type_traits>

#include "duet/core/robot_state.h"
#include "duet/hardware/safety/safety_machine.h"

namespace duet {

// The remote control as the robot passes it on: 40 bytes in each low-level state. Pure functions; thread-safe.

inline constexpr int kRemoteBytes = 40;

// Bits of RemoteControl::keys.
enum class RemoteKey : int { kR1, kL1, kStart, kSelect, kR2, kL2, kF1, kF2, kA, kB, kX, kY, kUp, kRight, kDown, kLeft };

struct RemoteControl {
  std::uint16_t keys = 0;
  float lx = 0.0f, ly = 0.0f, rx = 0.0f, ry = 0.0f;  // sticks, -1 to 1
  bool heard = false;  // not all bytes are 0, which is how the robot shows that the remote control is lost

  [[nodiscard]] bool holds(RemoteKey key) const { return ((keys >> static_cast<int>(key)) & 1) != 0; }
  // Select alone, or L2 with B: the maker's keys for damping.
  [[nodiscard]] bool asks_to_stop() const;
};

RemoteControl read_remote(std::span<const std::uint8_t, kRemoteBytes> bytes);
void write_remote(const RemoteControl& remote, std::span<std::uint8_t, kRemoteBytes> bytes);

static_assert(std::endian::native == std::endian::little, "the frames are those of a little-endian machine");

inline constexpr int kFrameMotors = 35;  // of a message
inline constexpr int kG1Motors = 29;     // of the robot, in the card's order

struct MotorCommandFrame {
  std::uint8_t mode;  // 1: enabled
  float q, dq, tau, kp, kd;
  std::uint32_t reserve;
};
static_assert(sizeof(MotorCommandFrame) == 28);

struct LowCommandFrame {
  std::uint8_t mode_pr, mode_machine;
  MotorCommandFrame motor[kFrameMotors];
  std::uint32_t reserve[4];
  std::uint32_t crc;
};
static_assert(sizeof(LowCommandFrame) == 1004);

struct ImuFrame {
  float quaternion[4];  // w, x, y, z
  float gyroscope[3], accelerometer[3], rpy[3];
  std::int16_t temperature;
};
static_assert(sizeof(ImuFrame) == 56);

struct MotorStateFrame {
  std::uint8_t mode;
  float q, dq, ddq, tau_est;
  std::int16_t temperature[2];  // casing, winding [degrees C]
  float vol;
  std::uint32_t sensor[2];
  std::uint32_t motorstate;  // 0: no error
  std::uint32_t reserve[4];
};
static_assert(sizeof(MotorStateFrame) == 56);

struct LowStateFrame {
  std::uint32_t version[2];
  std::uint8_t mode_pr, mode_machine;
  std::uint32_t tick;
  ImuFrame imu;
  MotorStateFrame motor[kFrameMotors];
  std::uint8_t wireless_remote[kRemoteBytes];
  std::uint32_t reserve[4];
  std::uint32_t crc;
};
static_assert(sizeof(LowStateFrame) == 2092);

// Joints by pitch and roll, not by the two motors of a parallel joint: the only meaning that is used here.
inline constexpr std::uint8_t kPitchRollMode = 0;

// A command for all joints; those without gains are enabled and limp. `command`: of kG1Motors joints.
void build_command(const JointCommand& command, std::uint8_t mode_machine, LowCommandFrame& frame);
// No stiffness, `kd` on every joint: what a robot that has to stop is sent, again and again [N m s/rad].
inline constexpr double kDampingGain = 8.0;
void build_damping(double kd, std::uint8_t mode_machine, LowCommandFrame& frame);

void seal(LowStateFrame& frame);  // sets the checksum

// Why a state is not used. The same one again is no fault: a sender that publishes more often than its robot counts
// (unitree_mujoco) repeats each. Nor is it news: a robot that only repeats grows old.
enum class FrameFault { kNone, kChecksum, kTick, kNotFinite, kRepeated };

struct RobotReading {
  RobotState state;     // X_WB.R and w_WB_B of the IMU, q, v; place and velocity of the base are odometry's
  Eigen::VectorXd tau;  // estimated by the motors [N m]
  RobotHealth health;
  RemoteControl remote;
  std::uint32_t tick = 0, checksum = 0;
  std::uint8_t mode_pr = 0, mode_machine = 0;
  bool any = false;  // a state has been read

  RobotReading();
};

// Reads a state that is whole and newer than the one in `reading`; leaves `reading` as it was for any other.
// `health.mode_is_expected` and `joints` are left to whoever knows the robot.
FrameFault read_state(const LowStateFrame& frame, RobotReading& reading);

// The checksum of the G1's low-level messages: CRC-32/MPEG-2 (polynomial 0x04C11DB7, first value 0xFFFFFFFF, nothing
// reflected, nothing inverted at the end) over 32-bit words, each from its highest bit. Source: unitree_sdk2,
// crc32_core.

std::uint32_t frame_checksum(std::span<const std::uint32_t> words);
// The same bit by bit, as the definition has it: what the table is tested against.
std::uint32_t frame_checksum_by_bits(std::span<const std::uint32_t> words);

// The checksum of all words of a message but its last, which holds it. Padding counts: a message is built from zeros.
template <typename Frame>
std::uint32_t checksum_of(const Frame& frame) {
  static_assert(std::is_trivially_copyable_v<Frame> && sizeof(Frame) % sizeof(std::uint32_t) == 0);
  std::uint32_t words[sizeof(Frame) / sizeof(std::uint32_t)];
  std::memcpy(words, &frame, sizeof(Frame));
  return frame_checksum(std::span<const std::uint32_t>(words).first(std::size(words) - 1));
}

}  // namespace duet
