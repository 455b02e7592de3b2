#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "duet/core/recording.h"
#include "duet/metrics/interaction.h"
#include "duet/robots/kinematics.h"

namespace duet {
namespace {

constexpr double kRate = 50.0;

// At rest until `begin`, then so far away along x.
Eigen::Matrix3Xd step(int frames, int begin, double distance) {
  Eigen::Matrix3Xd track = Eigen::Matrix3Xd::Constant(3, frames, 0.3);
  for (int t = begin; t < frames; ++t) track(0, t) += distance;
  return track;
}

TEST(Onset, AStepIsFoundWithinItsWindow) {
  // The mean over 10 frames passes 0.12 m where two of them are at 0.8 m: eight frames before the step.
  EXPECT_DOUBLE_EQ(onset({step(200, 120, 0.8)}, kRate), (120 - 8) / kRate);
  EXPECT_DOUBLE_EQ(onset({step(200, 120, 0.13)}, kRate), 120 / kRate);
}

TEST(Onset, TheFirstHandCounts) { EXPECT_DOUBLE_EQ(onset({step(200, 150, 0.13), step(200, 100, 0.13)}, kRate), 2.0); }

TEST(Onset, NothingBeyondTheThresholdIsNone) {
  EXPECT_TRUE(std::isnan(onset({step(200, 100, 0.119)}, kRate)));
  EXPECT_TRUE(std::isnan(onset({step(200, 300, 0.0)}, kRate)));
  EXPECT_TRUE(std::isnan(onset({}, kRate)));
}

TEST(Onset, AMotionThatEndsTooSoonHasNone) {
  EXPECT_TRUE(std::isnan(onset({step(30, 0, 1.0)}, kRate)));
  EXPECT_TRUE(std::isnan(onset({step(88, 50, 1.0)}, kRate)));  // one window short of the stay
  EXPECT_DOUBLE_EQ(onset({step(89, 50, 1.0)}, kRate), 1.0);
}

// Arms swing by half of a second to either side while a person walks.
TEST(Onset, ASwingThatComesBackIsNone) {
  Eigen::Matrix3Xd track = Eigen::Matrix3Xd::Zero(3, 400);
  for (int t = 0; t < 400; ++t) track(0, t) = 0.3 * std::sin(2.0 * std::numbers::pi * t / kRate);
  EXPECT_TRUE(std::isnan(onset({track}, kRate)));
  track.rightCols(150).row(2).array() += 0.3;
  const double found = onset({track}, kRate);
  EXPECT_NEAR(found, 5.0, kOnsetWindow + 0.5);  // at most half a swing before
}

TEST(Onset, TheRestIsTheMedianOfTheFirstSecond) {
  Eigen::Matrix3Xd track = step(200, 140, 0.19);
  track.leftCols(20).array() += 5.0;                           // less than half of it
  EXPECT_DOUBLE_EQ(onset({track}, kRate), (140 - 3) / kRate);  // seven frames of ten: 0.133 m; six: 0.114 m
}

// A robot that walks and turns with its arms still begins nothing; one that lifts an arm begins there.
TEST(Onset, OfARobotIsInItsPelvisFrame) {
  const auto robot = load_shared_robot();
  Recording recording;
  for (int t = 0; t < 200; ++t) {
    RobotState state = robot->standing_state({yaw_rotation(0.02 * t), {0.02 * t, 0.0, 0.8}});
    state.X_WB = {yaw_rotation(0.02 * t), {0.02 * t, 0.0, 0.8}};
    recording.robot.push_back(state);
  }
  recording.partner = PointTracks();
  EXPECT_TRUE(std::isnan(onsets(recording, *robot).at("onset_s")));
  EXPECT_FALSE(onsets(recording, *robot).contains("partner_onset_s"));
  int shoulder = -1;
  for (int j = 0; j < robot->dof(); ++j)
    if (robot->joints[static_cast<std::size_t>(j)].name == "left_shoulder_pitch_joint") shoulder = j;
  ASSERT_GE(shoulder, 0);
  for (std::size_t t = 100; t < 200; ++t) recording.robot[t].q[shoulder] -= 1.5;
  const double found = onsets(recording, *robot).at("onset_s");
  EXPECT_GE(found, 1.8);
  EXPECT_LE(found, 2.0);
}

TEST(Onset, OfAPartnerIsInItsRootFrame) {
  Recording recording;
  recording.partner = PointTracks(200, kSmplJoints);
  for (int t = 0; t < 200; ++t) {
    const Eigen::Vector3d root(0.03 * t, 0.0, 0.9);
    const Eigen::Quaterniond turn = yaw_rotation(0.015 * t);
    for (int j = 0; j < kSmplJoints; ++j) recording.partner.at(t, j) = root;
    recording.partner.at(t, kLeftHip) += turn * Eigen::Vector3d(0.0, 0.1, 0.0);
    recording.partner.at(t, kRightHip) += turn * Eigen::Vector3d(0.0, -0.1, 0.0);
    recording.partner.at(t, kLeftWrist) += turn * Eigen::Vector3d(0.0, 0.4, 0.0);
    recording.partner.at(t, kRightWrist) += turn * Eigen::Vector3d(t < 125 ? 0.0 : 0.13, -0.4, 0.0);
  }
  const auto robot = load_shared_robot();
  for (int t = 0; t < 200; ++t) recording.robot.push_back(robot->standing_state({}));
  EXPECT_DOUBLE_EQ(onsets(recording, *robot).at("partner_onset_s"), 2.5);
}

}  // namespace
}  // namespace duet
