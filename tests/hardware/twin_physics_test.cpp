// The twin with an engine behind it: what the wire commands is all that holds it up.
#include <cmath>
#include <cstring>
#include <limits>

#include "duet/backends/engine_module.h"
#include "duet/hardware/twin/twin_model.h"
#include "duet/hardware/twin/twin_operator.h"
#include "duet/hardware/wire/low_level_frame.h"
#include "tests/backends/engine_names.h"
#include "tests/hardware/limited_robot.h"
#include "tests/support.h"

namespace duet {
namespace {

#define NEEDS_MUJOCO() \
  if (!test::is_here("mujoco")) GTEST_SKIP() << "not run: mujoco absent"

TwinOptions simulated() { return {.engine = "mujoco"}; }

LowCommandFrame frame_of(const JointCommand& command) {
  LowCommandFrame frame;
  build_command(command, 5, frame);
  return frame;
}

void step_for(TwinModel& twin, double seconds) {
  for (double left = seconds; left > 0.5 * kTwinPeriod; left -= kTwinPeriod) twin.step(kTwinPeriod);
}

TEST(TwinPhysics, WithoutACommandItHangsFromItsRope) {
  NEEDS_MUJOCO();
  TwinModel twin(test::g1(), simulated());
  const double height = twin.root().p.z();
  step_for(twin, 3.0);
  EXPECT_GT(twin.root().p.z(), height - 0.1);
  EXPECT_LT(twin.root_speed(), 0.3);
}

TEST(TwinPhysics, LetDownLimpItFalls) {
  NEEDS_MUJOCO();
  TwinModel twin(test::g1(), simulated());
  twin.physics()->hang(0.0);
  step_for(twin, 2.0);
  EXPECT_LT(twin.root().p.z(), 0.5 * test::g1()->standing_height);
}

TEST(TwinPhysics, AJointGoesWhereTheWireTellsItTo) {
  NEEDS_MUJOCO();
  TwinModel twin(test::g1(), simulated());
  JointCommand command = test::g1()->default_command(test::g1()->neutral);
  const int elbow = test::g1()->roles.arms[0][3];
  command.q_target[elbow] += 0.4;
  twin.obey(frame_of(command));
  step_for(twin, 2.0);
  EXPECT_NEAR(twin.q()[elbow], command.q_target[elbow], 0.1);
}

// kp (q* - q) + kd (dq* - v) + tau. The engine evaluates the law at the end of its step, where the joint has begun to
// give way: up to a fifth less than at its begin.
TEST(TwinPhysics, TheMotorsLawHasSpeedAndTorqueOfTheWire) {
  NEEDS_MUJOCO();
  const int joint = test::g1()->roles.arms[0].back();
  const auto torque_under = [&](float dq, float tau) {
    TwinModel twin(test::g1(), simulated());
    LowCommandFrame frame = frame_of(test::g1()->default_command(test::g1()->neutral));
    frame.motor[joint].kd = 0.5f;
    frame.motor[joint].dq = dq;
    frame.motor[joint].tau = tau;
    frame.crc = checksum_of(frame);
    twin.obey(frame);
    twin.step(kTwinPeriod);
    return twin.physics()->torques()[joint];
  };
  const double rest = torque_under(0.0f, 0.0f);
  const auto expect_most_of = [](double found, double expected) {
    EXPECT_GT(found, 0.8 * expected);
    EXPECT_LT(found, 1.01 * expected);
  };
  expect_most_of(torque_under(0.4f, 0.0f) - rest, 0.2);
  expect_most_of(torque_under(0.0f, 0.3f) - rest, 0.3);
}

TEST(TwinPhysics, AMotorThatIsNotEnabledGivesNothing) {
  NEEDS_MUJOCO();
  TwinModel twin(test::g1(), simulated());
  LowCommandFrame frame = frame_of(test::g1()->default_command(test::g1()->neutral));
  for (MotorCommandFrame& motor : frame.motor) motor.mode = 0;
  frame.crc = checksum_of(frame);
  twin.obey(frame);
  twin.step(kTwinPeriod);
  EXPECT_EQ(twin.physics()->torques().array().abs().maxCoeff(), 0.0);
}

TEST(TwinPhysics, FramesThatNoMotorCouldTakeAreRefused) {
  NEEDS_MUJOCO();
  TwinModel twin(test::g1(), simulated());
  for (const float bad : {std::numeric_limits<float>::quiet_NaN(), std::numeric_limits<float>::infinity(), -1.0f}) {
    LowCommandFrame frame = frame_of(test::g1()->default_command(test::g1()->neutral));
    frame.motor[3].kp = bad;
    frame.crc = checksum_of(frame);
    twin.obey(frame);
  }
  EXPECT_EQ(twin.refused_frames(), 3);
  EXPECT_EQ(twin.obeyed_frames(), 0);
  EXPECT_NO_THROW(twin.step(kTwinPeriod));
}

TEST(TwinPhysics, AtRestTheAccelerometerReadsGravity) {
  NEEDS_MUJOCO();
  TwinModel twin(test::g1(), simulated());
  twin.obey(frame_of(test::g1()->default_command(test::g1()->neutral)));
  step_for(twin, 3.0);
  LowStateFrame frame;
  twin.write_state(frame);
  const Eigen::Vector3d force(frame.imu.accelerometer[0], frame.imu.accelerometer[1], frame.imu.accelerometer[2]);
  EXPECT_NEAR(force.norm(), kGravity, 0.5);
  EXPECT_GT(force.z(), 0.9 * kGravity);
}

TEST(TwinPhysics, TheSameSeedGivesTheSameFrames) {
  NEEDS_MUJOCO();
  TwinOptions noisy = simulated();
  noisy.joint_noise = noisy.gyro_noise = noisy.acceleration_noise = noisy.tilt_noise = noisy.joint_speed_noise = 0.01;
  TwinModel a(test::g1(), noisy), b(test::g1(), noisy);
  noisy.seed = 2;
  TwinModel other(test::g1(), noisy);
  LowStateFrame from_a, from_b, from_other;
  for (int k = 0; k < 50; ++k) {
    for (TwinModel* twin : {&a, &b, &other}) twin->step(kTwinPeriod);
    a.write_state(from_a);
    b.write_state(from_b);
    other.write_state(from_other);
    ASSERT_EQ(std::memcmp(&from_a, &from_b, sizeof(from_a)), 0);
  }
  EXPECT_NE(std::memcmp(&from_a, &from_other, sizeof(from_a)), 0);
}

TEST(TwinPhysics, RefusesAnotherStepAndAnUnknownEngine) {
  EXPECT_SENTENCE(test::thrown_message<std::invalid_argument>([] { TwinModel(test::g1(), {.engine = "mujocco"}); }));
  NEEDS_MUJOCO();
  TwinModel twin(test::g1(), simulated());
  EXPECT_SENTENCE(test::thrown_message<std::invalid_argument>([&] { twin.step(0.01); }));
}

TEST(TwinOperator, LetsNobodyDownWhoseArmsStillMove) {
  NEEDS_MUJOCO();
  TwinModel twin(test::g1(), simulated());
  TwinOperator person;
  JointCommand command = test::g1()->default_command(test::g1()->neutral);
  for (int k = 0; k < 1500; ++k) {
    command.q_target[test::g1()->roles.arms[0][3]] += 1e-4;
    twin.obey(frame_of(command));
    person.tick(twin.time(), twin);
    twin.step(kTwinPeriod);
  }
  EXPECT_EQ(twin.physics()->hanging(), 1.0);
}

// HOMIE's processes hold the motors from the begin on: nobody sees at the twin when the guard is armed.
TEST(TwinOperator, PressesStartAndAInTurnWhereOthersHoldTheMotors) {
  TwinModel twin(test::g1(), {});
  TwinOperator person;
  twin.obey(frame_of(test::g1()->default_command(test::g1()->neutral)));
  long starts = 0, runs = 0;
  std::uint16_t before = 0;
  for (int k = 0; k < 5000; ++k) {
    person.tick(twin.time(), twin);
    twin.step(kTwinPeriod);
    if (twin.remote.keys != before) {
      starts += twin.remote.holds(RemoteKey::kStart) ? 1 : 0;
      runs += twin.remote.holds(RemoteKey::kA) ? 1 : 0;
    }
    before = twin.remote.keys;
    EXPECT_TRUE(twin.remote.holds(RemoteKey::kR1));
  }
  EXPECT_GE(starts, 5);
  EXPECT_GE(runs, 5);
}

TEST(TwinOperator, StandsItUpLetsItDownAndAsksItToRun) {
  NEEDS_MUJOCO();
  TwinModel twin(test::g1(), simulated());
  TwinOperator person;
  const auto go_on = [&](double seconds, RemoteKey key) {
    bool pressed = false;
    for (double left = seconds; left > 0.5 * kTwinPeriod; left -= kTwinPeriod) {
      person.tick(twin.time(), twin);
      twin.step(kTwinPeriod);
      pressed = pressed || twin.remote.holds(key);
    }
    return pressed;
  };
  EXPECT_FALSE(go_on(1.0, RemoteKey::kStart)) << "limp: nobody has damped it yet";
  LowCommandFrame damping;
  build_damping(kDampingGain, 5, damping);
  twin.obey(damping);
  EXPECT_TRUE(go_on(1.0, RemoteKey::kStart));
  EXPECT_EQ(twin.physics()->hanging(), 1.0);
  twin.obey(frame_of(test::g1()->default_command(test::g1()->neutral)));
  EXPECT_FALSE(go_on(2.5, RemoteKey::kA));
  EXPECT_EQ(twin.physics()->hanging(), 0.0);
  EXPECT_TRUE(go_on(1.0, RemoteKey::kA));
  twin.obey(damping);
  go_on(2.0, RemoteKey::kA);
  EXPECT_EQ(twin.physics()->hanging(), 0.0) << "nobody hangs it back on its rope";
  EXPECT_TRUE(has_fallen(twin.physics()->state(), test::g1()->fall)) << "damped, it falls";
}

}  // namespace
}  // namespace duet
