#include "duet/hardware/twin/twin_model.h"

#include <algorithm>
#include <cmath>
#include <cstring>

#include "duet/hardware/wire/low_level_frame.h"
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
  EXPECT_LT((twin.q() - test::g1()->neutral).array().abs().maxCoeff(), 0.11);
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

}  // namespace
}  // namespace duet
