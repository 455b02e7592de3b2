#include "duet/hardware/twin/twin_model.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>

#include "duet/backends/engine_module.h"
#include "duet/hardware/twin/twin_operator.h"
#include "duet/hardware/wire/low_level_frame.h"
#include "tests/backends/engine_names.h"
#include "tests/hardware/limited_robot.h"
#include "tests/support.h"

namespace duet {
namespace {

constexpr double kDt = 0.002;

LowCommandFrame towards(double offset) {
  JointCommand command = test::g1()->default_command(test::g1()->neutral);
  command.q_target.array() += offset;
  LowCommandFrame frame;
  build_command(command, 5, frame);
  return frame;
}

TEST(TwinModel, ItsJointsGoWhereTheyAreTold) {
  TwinModel twin(test::g1(), {});
  twin.obey(towards(0.1));
  for (int k = 0; k < 2000; ++k) twin.step(kDt);
  EXPECT_LT((twin.q() - test::g1()->neutral).array().abs().maxCoeff(), 0.13);  // arms sag by their weight
  EXPECT_GT((twin.q() - test::g1()->neutral)[15], 0.09);
}

TEST(TwinModel, ObeysOnlyWholeFramesForItself) {
  TwinModel twin(test::g1(), {});
  LowCommandFrame frame = towards(0.1);
  frame.motor[0].q += 1.0f;
  twin.obey(frame);
  frame = towards(0.1);
  frame.mode_machine = 6;
  frame.crc = checksum_of(frame);
  twin.obey(frame);
  EXPECT_EQ(twin.refused_frames(), 2);
  EXPECT_EQ(twin.obeyed_frames(), 0);
}

TEST(TwinModel, ItsRootFollowsAfterDelayAndLag) {
  TwinModel twin(test::g1(), {.lag = 0.3, .delay = 0.1});
  twin.obey(VelocityCommand{0.2, 0.0, 0.0, 0.74});
  for (int k = 0; k < 49; ++k) twin.step(kDt);
  EXPECT_EQ(twin.root_speed(), 0.0);
  for (int k = 0; k < 151; ++k) twin.step(kDt);
  EXPECT_NEAR(twin.root_speed(), 0.2 * (1.0 - std::exp(-1.0)), 0.003);
}

TEST(TwinModel, TheSameSeedGivesTheSameFrames) {
  const TwinOptions noisy{.place_noise = 0.01, .joint_noise = 0.001, .seed = 7};
  TwinModel a(test::g1(), noisy), b(test::g1(), noisy);
  for (int k = 0; k < 20; ++k) {
    LowStateFrame from_a, from_b;
    a.write_state(from_a);
    b.write_state(from_b);
    EXPECT_EQ(std::memcmp(&from_a, &from_b, sizeof(from_a)), 0);
    EXPECT_EQ(a.odometry(0.0).X_WB.p, b.odometry(0.0).X_WB.p);
  }
}

// Programs that take gravity from the angles see the same tilt as those that take it from the quaternion.
TEST(TwinModel, ItsImusAnglesAreThoseOfItsQuaternion) {
  TwinModel twin(test::g1(), {.tilt_noise = 0.3});
  twin.obey(VelocityCommand{0.0, 0.0, 0.5, 0.74});
  for (int k = 0; k < 20; ++k) {
    for (int step = 0; step < 100; ++step) twin.step(kDt);
    LowStateFrame frame;
    twin.write_state(frame);
    const float* rpy = frame.imu.rpy;
    const Eigen::Quaterniond R = yaw_rotation(rpy[2]) * Eigen::AngleAxisd(rpy[1], Eigen::Vector3d::UnitY()) *
                                 Eigen::AngleAxisd(rpy[0], Eigen::Vector3d::UnitX());
    const float* wxyz = frame.imu.quaternion;
    EXPECT_LT(R.angularDistance(Eigen::Quaterniond(wxyz[0], wxyz[1], wxyz[2], wxyz[3])), 1e-5) << k;
  }
}

// Its second IMU is on the trunk: turned by the waist, with the waist's rate. Motors say how fast they gain speed.
TEST(TwinModel, ItsSecondImuTurnsWithTheWaist) {
  TwinModel twin(test::g1(), {});
  twin.condition.roll = 0.2;
  JointCommand command = test::g1()->default_command(test::g1()->neutral);
  command.q_target[12] += 0.6;  // waist yaw
  LowCommandFrame frame;
  build_command(command, 5, frame);
  twin.obey(frame);
  double largest = 0.0;
  for (int step = 0; step < 500; ++step) {
    const double before = twin.q()[12];
    LowStateFrame last, state;
    twin.write_state(last);
    twin.step(kDt);
    twin.write_state(state);
    ImuFrame trunk;
    twin.write_trunk_imu(trunk);
    EXPECT_NEAR(trunk.gyroscope[2], (twin.q()[12] - before) / kDt, 1e-4) << step;
    EXPECT_NEAR(state.motor[12].ddq, (state.motor[12].dq - last.motor[12].dq) / kDt, 1e-2) << step;
    largest = std::max(largest, std::abs(static_cast<double>(trunk.gyroscope[2])));
  }
  EXPECT_GT(largest, 0.1);
  LowStateFrame state;
  ImuFrame trunk;
  twin.write_state(state);
  twin.write_trunk_imu(trunk);
  EXPECT_NEAR(state.imu.rpy[0], 0.2, 1e-5);
  const auto read = [](const float* wxyz) { return Eigen::Quaterniond(wxyz[0], wxyz[1], wxyz[2], wxyz[3]); };
  const Eigen::Quaterniond R_BT = read(state.imu.quaternion).conjugate() * read(trunk.quaternion);
  EXPECT_LT(R_BT.angularDistance(yaw_rotation(twin.q()[12])), 1e-5);
  EXPECT_GT(twin.q()[12], 0.4);
  const float* force = state.imu.accelerometer;
  const Eigen::Vector3d force_T = R_BT.conjugate() * Eigen::Vector3d(force[0], force[1], force[2]);
  for (int axis = 0; axis < 3; ++axis) EXPECT_NEAR(trunk.accelerometer[axis], force_T[axis], 1e-4);
  EXPECT_EQ(state.motor[3].vol, 48.0f);
  EXPECT_EQ(state.motor[30].vol, 0.0f);  // the robot has 29
}

TEST(TwinModel, OdometryDrifts) {
  TwinModel twin(test::g1(), {.drift = 0.05});
  for (int k = 0; k < 500; ++k) twin.step(kDt);
  EXPECT_NEAR(twin.odometry(0.0).X_WB.p.x() - twin.root().p.x(), 0.05, 1e-9);
}

TEST(TwinModel, RefusesAnotherRobotAndNegativeOptions) {
  const auto refusal = [](const char* robot, const TwinOptions& options) {
    return test::thrown_message<std::invalid_argument>([&] { TwinModel(load_shared_robot(robot), options); });
  };
  EXPECT_SENTENCE(refusal("g1_12dof", {}));
  EXPECT_SENTENCE(refusal("", {.lag = -1.0}));
}

TEST(TwinFault, IsReadFromText) {
  const TwinFault fault = parse_twin_fault("drop@3:5.5=100");
  EXPECT_EQ(fault.kind, TwinFaultKind::kDrop);
  EXPECT_EQ(fault.begin, 3.0);
  EXPECT_EQ(fault.end, 5.5);
  EXPECT_EQ(fault.value, 100.0);
  EXPECT_EQ(parse_twin_fault("freeze@0:1").kind, TwinFaultKind::kFreeze);
}

TEST(TwinFault, RefusesWhatItCannotRead) {
  const auto refusal = [](const char* text) {
    return test::thrown_message<std::invalid_argument>([&] { (void)parse_twin_fault(text); });
  };
  for (const char* text :
       {"", "drop", "drop@3", "drop:3@5", "drop@x:5", "drop@3:5=", "drop@5:3=1", "drop@3:5=-1", "drop@3:3"})
    EXPECT_SENTENCE(refusal(text));
  EXPECT_SENTENCE(refusal("dorp@3:5"));
}

// The states of two seconds at 100 Hz, as they leave, with a fault in the second one.
std::vector<LowStateFrame> states_with(const std::string& fault, TwinModel& twin) {
  FaultyTwin faulty(twin, {parse_twin_fault(fault)}, 1);
  std::vector<LowStateFrame> states;
  for (int k = 0; k < 200; ++k) {
    LowStateFrame frame;
    if (faulty.next_state(0.01 * k, frame)) states.push_back(frame);
  }
  return states;
}

long bad_checksums(const std::vector<LowStateFrame>& states) {
  return std::ranges::count_if(states, [](const auto& state) { return state.crc != checksum_of(state); });
}

TEST(TwinFault, DropsDelaysFlipsAndFreezes) {
  TwinModel dropped(test::g1(), {}), late(test::g1(), {}), flipped(test::g1(), {}), frozen(test::g1(), {});
  EXPECT_EQ(states_with("drop@1:2=100", dropped).size(), 100u);
  EXPECT_NEAR(states_with("delay@1:2=50", late).size(), 195, 1);
  EXPECT_NEAR(bad_checksums(states_with("flip@1:2=50", flipped)), 50, 20);
  const std::vector<LowStateFrame> states = states_with("freeze@1:2", frozen);
  EXPECT_EQ(states.back().tick, 100u);
  EXPECT_EQ(bad_checksums(states), 0);
}

TEST(TwinFault, ChangesWhatTheRobotReports) {
  TwinModel twin(test::g1(), {});
  const auto last = [&](const char* fault) {
    RobotReading reading;
    FaultyTwin faulty(twin, {parse_twin_fault(fault)}, 1);
    LowStateFrame frame;
    EXPECT_TRUE(faulty.next_state(1.5, frame));
    (void)read_state(frame, reading);
    return reading;
  };
  EXPECT_EQ(last("hot@1:2=110").health.winding, 110.0);
  EXPECT_NEAR(last("tilt@1:2=0.6").health.tilt, 0.6, 1e-6);
  EXPECT_FALSE(last("remote_lost@1:2").remote.heard);
  EXPECT_EQ(last("mode@1:2").mode_machine, 6);
  twin.remote.keys = 0xFFFF;
  EXPECT_FALSE(last("dead_man@1:2").remote.holds(RemoteKey::kR1));
  EXPECT_FALSE(last("nan@1:2").any);
}

// The twin with an engine behind it: what the wire commands is all that holds it up.

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
