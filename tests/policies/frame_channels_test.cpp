#include "duet/policies/frame_channels.h"

#include <stdexcept>

#include "duet/policies/dstar/features.h"
#include "tests/policies/fixtures.h"
#include "tests/support.h"

namespace duet {
namespace {

using test::g1;

constexpr double kFloat = 1e-6;  // of float, of numbers up to 8

ObservationFrame random_frame(Random& random) {
  ObservationFrame frame;
  for (double& value : frame.partner.reshaped()) value = random.normal();
  const Reference reference = test::random_reference(random, 29);
  frame.robot = {reference.X_WB, Eigen::Vector3d(1, 2, 3), Eigen::Vector3d(4, 5, 6), reference.q, 2.0 * reference.q};
  return frame;
}

Eigen::VectorXd shown(const FrameSenses& senses, ChannelKind angles = ChannelKind::kJointAngle) {
  std::vector<float> numbers(kObservationSize);
  write_frame(frame_channels(angles), senses, numbers);
  return Eigen::Map<const Eigen::VectorXf>(numbers.data(), kObservationSize).cast<double>();
}

TEST(FrameChannels, InTheWorldHaveTheLayoutOfTheSupplement) {
  Random random(1, 1);
  const ObservationFrame frame = random_frame(random);
  const RobotState& robot = frame.robot;
  const Eigen::Vector3d start(0.1, 0.2, 0.3);
  const Eigen::VectorXd vector = shown(FrameSenses::in_world(frame, *g1(), {}, start));
  EXPECT_TRUE(vector.segment<3>(0).isApprox(frame.partner.col(0), kFloat));
  for (int j = 0; j < 24; ++j) EXPECT_TRUE(vector.segment<3>(3 + 3 * j).isApprox(frame.partner.col(j), kFloat)) << j;
  EXPECT_NEAR((robot.X_WB.R * vector.segment<3>(75) - robot.v_WB).norm(), 0.0, kFloat);
  EXPECT_EQ(vector.segment<3>(78), robot.w_WB_B);
  EXPECT_NEAR((robot.X_WB.R * vector.segment<3>(81) + Eigen::Vector3d::UnitZ()).norm(), 0.0, kFloat);
  EXPECT_TRUE(vector.segment<29>(84).isApprox(robot.q, kFloat));
  EXPECT_TRUE(vector.segment<29>(113).isApprox(robot.v, kFloat));
  EXPECT_TRUE(vector.segment<3>(142).isApprox(robot.X_WB.p - start, kFloat));
  EXPECT_NEAR(std::abs(vector.segment<4>(145).dot(
                  Eigen::Vector4d(robot.X_WB.R.w(), robot.X_WB.R.x(), robot.X_WB.R.y(), robot.X_WB.R.z()))),
              1.0, kFloat);
  EXPECT_GE(vector[145], 0.0);
}

// A frame that is moved and turned about the vertical with the robot shows the same.
TEST(FrameChannels, OfTheRobotDoNotChangeWhenTheWorldIsTurned) {
  Random random(3, 1);
  const ObservationFrame frame = random_frame(random);
  const Pose X_VW{yaw_rotation(1.1), {3.0, -2.0, 0.0}};
  ObservationFrame moved = frame;
  moved.robot.X_WB = X_VW * frame.robot.X_WB;
  moved.robot.v_WB = X_VW.R * frame.robot.v_WB;
  for (int j = 0; j < kSmplJoints; ++j) moved.partner.col(j) = X_VW * Eigen::Vector3d(frame.partner.col(j));
  const auto ego = [](const ObservationFrame& of) {
    return shown(FrameSenses::in_ego(of, *g1(), {}, ego_frame(of.robot).inverse()), ChannelKind::kJointPosition);
  };
  EXPECT_NEAR((ego(moved) - ego(frame)).cwiseAbs().maxCoeff(), 0.0, 4.0 * kFloat);
  EXPECT_TRUE(ego(frame).segment<29>(84).isApprox(frame.robot.q - g1()->neutral, kFloat));
}

// D-STAR's networks were trained on the numbers of this one expression: not one bit may differ.
TEST(FrameChannels, OfTheRobotAreTheBitsThatNetworksWereTrainedOn) {
  Random random(6, 1);
  for (int i = 0; i < 200; ++i) {
    const ObservationFrame frame = random_frame(random), now = random_frame(random);
    const RobotState& robot = frame.robot;
    const Pose X_EW = ego_frame(now.robot).inverse(), X_EB = X_EW * robot.X_WB;
    const Eigen::Matrix3d R_BW = robot.X_WB.R.conjugate().toRotationMatrix(), R_EW = X_EW.R.toRotationMatrix();
    const Eigen::Matrix<double, 3, kSmplJoints> joints = R_EW * (frame.partner.colwise() - frame.partner.col(0));
    Eigen::Matrix<float, kObservationSize, 1> trained, shown;
    trained << (X_EW * Eigen::Vector3d(frame.partner.col(0))).cast<float>(), joints.reshaped().cast<float>(),
        (R_BW * robot.v_WB).cast<float>(), robot.w_WB_B.cast<float>(), (-R_BW.col(2)).cast<float>(),
        (robot.q - g1()->neutral).cast<float>(), robot.v.cast<float>(), X_EB.p.cast<float>(),
        wxyz_of(X_EB.R).cast<float>();
    write_frame(frame_channels(ChannelKind::kJointPosition), FrameSenses::in_ego(frame, *g1(), {}, X_EW),
                {shown.data(), kObservationSize});
    ASSERT_EQ(shown, trained) << i;
  }
}

TEST(FrameChannels, AreTheSameForBothSignsOfAQuaternion) {
  Random random(2, 1);
  for (int i = 0; i < 10; ++i) {
    ObservationFrame frame = random_frame(random);
    const Eigen::VectorXd vector = shown(FrameSenses::in_world(frame, *g1(), {}, {0, 0, 0}));
    frame.robot.X_WB.R.coeffs() *= -1.0;
    EXPECT_NEAR((shown(FrameSenses::in_world(frame, *g1(), {}, {0, 0, 0})) - vector).norm(), 0.0, kFloat);
  }
}

TEST(FrameChannels, ShowJointsInTheOrderThatIsAsked) {
  Random random(4, 1);
  const ObservationFrame frame = random_frame(random);
  std::vector<float> numbers(29);
  ChannelWriter writer(numbers);
  std::vector<int> joints(29);
  for (int j = 0; j < 29; ++j) joints[j] = 28 - j;
  FrameSenses::in_world(frame, *g1(), joints, {0, 0, 0}).show(ChannelKind::kJointVelocity, writer);
  for (int j = 0; j < 29; ++j) EXPECT_FLOAT_EQ(numbers[j], static_cast<float>(frame.robot.v[28 - j]));
}

TEST(FrameChannels, RefuseAChannelThatIsNotOfAFrame) {
  Random random(5, 1);
  const ObservationFrame frame = random_frame(random);
  float number = 0.0F;
  ChannelWriter writer({&number, 1});
  EXPECT_THROW(FrameSenses::in_world(frame, *g1(), {}, {0, 0, 0}).show(ChannelKind::kTick, writer), std::logic_error);
}

}  // namespace
}  // namespace duet
