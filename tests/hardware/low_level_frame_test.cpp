// Golden frames: the bytes and checksums below were packed by another program from the published layout.
#include "duet/hardware/wire/low_level_frame.h"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <cstddef>
#include <cstring>
#include <functional>
#include <limits>
#include <vector>

#include "duet/core/numbers.h"
#include "duet/hardware/wire/low_level_frame.h"
#include "tests/backends/allocation_count.h"

namespace duet {
namespace {

constexpr std::uint8_t kMachine = 5;
constexpr float kNan = std::numeric_limits<float>::quiet_NaN();

TEST(FrameChecksum, IsThatOfItsDefinition) {
  const std::uint32_t digits[] = {0x31323334, 0x35363738};  // "12345678", each word from its highest byte
  EXPECT_EQ(frame_checksum(digits), 0x49E3C2FBu);
  EXPECT_EQ(frame_checksum(std::vector<std::uint32_t>(250, 0)), 0xFE172F9Fu);
  EXPECT_EQ(frame_checksum(std::vector<std::uint32_t>(522, 0)), 0xD64BB04Au);
}

TEST(FrameChecksum, TableAndBitsAgree) {
  Random random(19, 5);
  for (int length = 0; length < 60; ++length) {
    std::vector<std::uint32_t> words(length);
    for (std::uint32_t& word : words) word = static_cast<std::uint32_t>(random.bits());
    EXPECT_EQ(frame_checksum(words), frame_checksum_by_bits(words)) << length;
  }
}

JointCommand golden_command() {
  JointCommand command;
  command.q_target = 0.1 * Eigen::VectorXd::LinSpaced(kG1Motors, 0.0, kG1Motors - 1.0);
  command.kp.setConstant(kG1Motors, 60.0);
  command.kd.setConstant(kG1Motors, 1.5);
  command.tau_ff.setConstant(kG1Motors, -0.5);
  return command;
}

TEST(LowCommandFrame, HasTheGoldenBytes) {
  LowCommandFrame frame;
  std::memset(&frame, 0xAB, sizeof(frame));  // what was in the buffer before does not show
  build_command(golden_command(), kMachine, frame);
  EXPECT_EQ(frame.crc, 0x7F82B9D6u);
  build_damping(kDampingGain, kMachine, frame);
  EXPECT_EQ(frame.crc, 0xE61896D2u);
  const unsigned char motor[28] = {1, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0x41};
  EXPECT_EQ(std::memcmp(&frame.motor[0], motor, sizeof(motor)), 0);
}

TEST(LowCommandFrame, EnablesTheRobotsMotorsAndNoOthers) {
  LowCommandFrame frame;
  build_command(golden_command(), kMachine, frame);
  EXPECT_EQ(frame.mode_pr, 0);
  EXPECT_EQ(frame.mode_machine, kMachine);
  for (int j = 0; j < kFrameMotors; ++j) {
    EXPECT_EQ(frame.motor[j].mode, j < kG1Motors ? 1 : 0) << j;
    EXPECT_EQ(frame.motor[j].kp, j < kG1Motors ? 60.0f : 0.0f) << j;
  }
}

TEST(LowCommandFrame, DampingHasNoStiffnessAndNoTarget) {
  LowCommandFrame frame;
  build_damping(kDampingGain, kMachine, frame);
  for (int j = 0; j < kG1Motors; ++j) {
    EXPECT_EQ(frame.motor[j].kp, 0.0f);
    EXPECT_EQ(frame.motor[j].tau, 0.0f);
    EXPECT_EQ(frame.motor[j].kd, 8.0f);
  }
}

TEST(LowCommandFrame, DirtyPaddingChangesTheChecksum) {
  LowCommandFrame frame;
  build_damping(kDampingGain, kMachine, frame);
  const std::uint32_t clean = frame.crc;
  reinterpret_cast<unsigned char*>(&frame)[offsetof(LowCommandFrame, motor) + 1] = 0x5A;
  EXPECT_NE(checksum_of(frame), clean);
}

TEST(LowCommandFrame, IsBuiltWithoutAllocation) {
  if (!test::allocations_are_counted()) GTEST_SKIP() << "not run: the sanitizer has a malloc of its own";
  const JointCommand command = golden_command();
  LowCommandFrame frame;
  const long before = test::allocation_count();
  build_command(command, kMachine, frame);
  build_damping(kDampingGain, kMachine, frame);
  EXPECT_EQ(test::allocation_count(), before);
}

LowStateFrame golden_state() {
  LowStateFrame frame;
  std::memset(&frame, 0, sizeof(frame));
  frame.version[0] = 1;
  frame.version[1] = 2;
  frame.mode_machine = kMachine;
  frame.tick = 7;
  frame.imu.quaternion[0] = 1.0f;
  for (int axis = 0; axis < 3; ++axis) frame.imu.gyroscope[axis] = static_cast<float>(0.1 * (axis + 1.0));
  frame.imu.gyroscope[2] = 0.3f;
  frame.imu.accelerometer[2] = 9.81f;
  frame.imu.temperature = 25;
  for (int j = 0; j < kG1Motors; ++j) {
    MotorStateFrame& motor = frame.motor[j];
    motor.mode = 1;
    motor.q = static_cast<float>(0.05 * j);
    motor.dq = static_cast<float>(0.01 * j);
    motor.tau_est = 0.2f;
    motor.temperature[0] = 30;
    motor.temperature[1] = 40;
  }
  seal(frame);
  return frame;
}

TEST(LowStateFrame, HasTheGoldenChecksum) { EXPECT_EQ(golden_state().crc, 0x173622B5u); }

TEST(LowStateFrame, IsReadWhole) {
  RobotReading reading;
  ASSERT_EQ(read_state(golden_state(), reading), FrameFault::kNone);
  EXPECT_NEAR(reading.state.q[10], 0.5, 1e-6);
  EXPECT_NEAR(reading.state.v[28], 0.28, 1e-6);
  EXPECT_NEAR(reading.tau[3], 0.2, 1e-6);
  EXPECT_NEAR(reading.state.w_WB_B.y(), 0.2, 1e-6);
  EXPECT_EQ(reading.health.casing, 30.0);
  EXPECT_EQ(reading.health.winding, 40.0);
  EXPECT_NEAR(reading.health.joint_speed, 0.28, 1e-6);
  EXPECT_NEAR(reading.health.tilt, 0.0, 1e-6);
  EXPECT_FALSE(reading.health.motor_error);
  EXPECT_EQ(reading.mode_machine, kMachine);
  EXPECT_FALSE(reading.remote.heard);
}

FrameFault fault_of(const std::function<void(LowStateFrame&)>& spoil, RobotReading reading = {}) {
  LowStateFrame frame = golden_state();
  spoil(frame);
  seal(frame);
  const RobotReading before = reading;
  const FrameFault fault = read_state(frame, reading);
  if (fault != FrameFault::kNone) {
    EXPECT_EQ(reading.state.q, before.state.q);
    EXPECT_EQ(reading.tick, before.tick);
  }
  return fault;
}

TEST(LowStateFrame, AnyFlippedBitIsNoticed) {
  Random random(19, 6);
  for (int k = 0; k < 2000; ++k) {
    LowStateFrame frame = golden_state();
    reinterpret_cast<unsigned char*>(&frame)[random.below(sizeof(frame))] ^= 1u << random.below(8);
    RobotReading reading;
    EXPECT_EQ(read_state(frame, reading), FrameFault::kChecksum) << k;
  }
}

TEST(LowStateFrame, ATickThatDoesNotRiseIsNoticed) {
  RobotReading reading;
  reading.any = true;
  for (const std::uint32_t last : {7u, 8u, 1000u}) {
    reading.tick = last;
    EXPECT_EQ(fault_of([](LowStateFrame&) {}, reading), FrameFault::kTick) << last;
  }
  reading.tick = 6;
  EXPECT_EQ(fault_of([](LowStateFrame&) {}, reading), FrameFault::kNone);
  reading.tick = 0xFFFFFFF0u;  // counted past 2^32
  EXPECT_EQ(fault_of([](LowStateFrame&) {}, reading), FrameFault::kNone);
}

TEST(LowStateFrame, TheSameAgainIsRepeatedAndAnotherOfThatTickIsAFault) {
  RobotReading reading;
  ASSERT_EQ(read_state(golden_state(), reading), FrameFault::kNone);
  EXPECT_EQ(fault_of([](LowStateFrame&) {}, reading), FrameFault::kRepeated);
  EXPECT_EQ(fault_of([](LowStateFrame& f) { f.motor[0].q += 0.1f; }, reading), FrameFault::kTick);
}

TEST(LowStateFrame, NumbersThatAreNotFiniteAreNoticed) {
  for (const float bad : {kNan, std::numeric_limits<float>::infinity()}) {
    EXPECT_EQ(fault_of([=](LowStateFrame& f) { f.motor[28].q = bad; }), FrameFault::kNotFinite);
    EXPECT_EQ(fault_of([=](LowStateFrame& f) { f.motor[0].dq = bad; }), FrameFault::kNotFinite);
    EXPECT_EQ(fault_of([=](LowStateFrame& f) { f.motor[5].tau_est = bad; }), FrameFault::kNotFinite);
    EXPECT_EQ(fault_of([=](LowStateFrame& f) { f.imu.quaternion[2] = bad; }), FrameFault::kNotFinite);
    EXPECT_EQ(fault_of([=](LowStateFrame& f) { f.imu.gyroscope[1] = bad; }), FrameFault::kNotFinite);
  }
  EXPECT_EQ(fault_of([](LowStateFrame& f) { f.motor[34].q = kNan; }), FrameFault::kNone);  // no motor is there
}

TEST(LowStateFrame, HealthIsThatOfTheWorstMotor) {
  LowStateFrame frame = golden_state();
  frame.motor[20].temperature[0] = 80;
  frame.motor[3].temperature[1] = 110;
  frame.motor[28].motorstate = 4;
  frame.motor[7].dq = -11.0f;
  frame.imu.quaternion[0] = static_cast<float>(std::cos(0.3));
  frame.imu.quaternion[1] = static_cast<float>(std::sin(0.3));
  seal(frame);
  RobotReading reading;
  ASSERT_EQ(read_state(frame, reading), FrameFault::kNone);
  EXPECT_EQ(reading.health.casing, 80.0);
  EXPECT_EQ(reading.health.winding, 110.0);
  EXPECT_TRUE(reading.health.motor_error);
  EXPECT_NEAR(reading.health.joint_speed, 11.0, 1e-6);
  EXPECT_NEAR(reading.health.tilt, 0.6, 1e-6);
}

TEST(LowStateFrame, AnOrientationOfZerosCountsAsFallen) {
  LowStateFrame frame = golden_state();
  frame.imu.quaternion[0] = 0.0f;
  seal(frame);
  RobotReading reading;
  ASSERT_EQ(read_state(frame, reading), FrameFault::kNone);
  EXPECT_GT(reading.health.tilt, 3.0);
}

using Bytes = std::array<std::uint8_t, kRemoteBytes>;

TEST(RemoteControl, KeysAndSticksStandAtTheirPlaces) {
  Bytes bytes{};
  bytes[0] = 0x55;
  bytes[2] = 0x10;  // bit 4: R2
  bytes[3] = 0x01;  // bit 8: A
  bytes[23] = 0x3F;
  bytes[22] = 0x80;  // ly = 1
  const RemoteControl remote = read_remote(bytes);
  EXPECT_TRUE(remote.heard);
  EXPECT_TRUE(remote.holds(RemoteKey::kR2));
  EXPECT_TRUE(remote.holds(RemoteKey::kA));
  EXPECT_FALSE(remote.holds(RemoteKey::kB));
  EXPECT_EQ(remote.ly, 1.0f);
  EXPECT_EQ(remote.lx, 0.0f);
}

TEST(RemoteControl, ZerosAloneMeanThatItIsLost) {
  EXPECT_FALSE(read_remote(Bytes{}).heard);
  Bytes bytes{};
  bytes[39] = 1;
  EXPECT_TRUE(read_remote(bytes).heard);
}

TEST(RemoteControl, WhatIsWrittenIsRead) {
  const RemoteControl sent{.keys = 0x8421, .lx = -0.5f, .ly = 0.25f, .rx = 1.0f, .ry = -1.0f, .heard = true};
  Bytes bytes;
  bytes.fill(0xFF);
  write_remote(sent, bytes);
  const RemoteControl read = read_remote(bytes);
  EXPECT_EQ(read.keys, sent.keys);
  EXPECT_EQ(read.lx, sent.lx);
  EXPECT_EQ(read.ly, sent.ly);
  EXPECT_EQ(read.rx, sent.rx);
  EXPECT_EQ(read.ry, sent.ry);
  write_remote({}, bytes);
  EXPECT_FALSE(read_remote(bytes).heard);
}

TEST(RemoteControl, SelectStopsAndSoDoL2WithB) {
  const auto stops = [](std::initializer_list<RemoteKey> keys) {
    RemoteControl remote;
    for (const RemoteKey key : keys) remote.keys |= static_cast<std::uint16_t>(1u << static_cast<int>(key));
    return remote.asks_to_stop();
  };
  EXPECT_TRUE(stops({RemoteKey::kSelect}));
  EXPECT_TRUE(stops({RemoteKey::kL2, RemoteKey::kB}));
  EXPECT_FALSE(stops({RemoteKey::kL2}));
  EXPECT_FALSE(stops({RemoteKey::kB}));
  EXPECT_FALSE(stops({RemoteKey::kStart, RemoteKey::kA, RemoteKey::kR2}));
}

}  // namespace
}  // namespace duet
