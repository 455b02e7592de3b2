#include "duet/metrics/locomotion.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "duet/metrics/catalogue.h"
#include "duet/robots/robot_model.h"

namespace duet {
namespace {

std::shared_ptr<const RobotModel> g1() {
  static const auto robot = load_shared_robot();
  return robot;
}

// A robot that glides: `velocity` in its heading, `rate` about z, from the origin with heading `yaw`.
Recording gliding(double seconds, const Eigen::Vector2d& velocity, double rate, double yaw = 0.0) {
  Recording recording;
  const double dt = 1.0 / recording.rate_hz;
  RobotState state = g1()->standing_state();
  state.v = Eigen::VectorXd::Zero(g1()->dof());
  for (int t = 0; t < std::lround(seconds * recording.rate_hz); ++t) {
    state.X_WB.R = yaw_rotation(yaw);
    state.v_WB = yaw_rotation(yaw) * Eigen::Vector3d(velocity.x(), velocity.y(), 0.0);
    state.w_WB_B = {0.0, 0.0, rate};
    recording.robot.push_back(state);
    recording.reference.push_back({state.X_WB, state.q});
    state.X_WB.p += dt * state.v_WB;
    yaw += dt * rate;
  }
  return recording;
}

TEST(Locomotion, SpeedsAreInTheHeadingAndDriftIsInTheWorld) {
  const auto metrics = locomotion_metrics(gliding(6.0, {0.5, -0.1}, 0.0, 2.0), *g1());
  EXPECT_NEAR(metrics.at("speed_forward"), 0.5, 1e-12);
  EXPECT_NEAR(metrics.at("speed_sideways"), -0.1, 1e-12);
  EXPECT_NEAR(metrics.at("turn_rate"), 0.0, 1e-12);
  EXPECT_NEAR(metrics.at("drift"), std::hypot(0.5, 0.1) * (6.0 - 0.02), 1e-9);
}

TEST(Locomotion, ATurnKeepsItsSpeedInTheHeading) {
  const auto metrics = locomotion_metrics(gliding(6.0, {0.3, 0.0}, 0.4), *g1());
  EXPECT_NEAR(metrics.at("speed_forward"), 0.3, 1e-12);
  EXPECT_NEAR(metrics.at("turn_rate"), 0.4, 1e-12);
}

// The first two seconds are not of the means: a robot that walks only then has walked, but has no speed.
TEST(Locomotion, MeansAreOfWhatIsAfterTwoSeconds) {
  Recording recording = gliding(4.0, {0.5, 0.0}, 0.0);
  for (std::size_t t = 100; t < recording.robot.size(); ++t) recording.robot[t].v_WB.setZero();
  EXPECT_EQ(locomotion_metrics(recording, *g1()).at("speed_forward"), 0.0);
  EXPECT_FALSE(locomotion_metrics(gliding(2.0, {0.5, 0.0}, 0.0), *g1()).contains("speed_forward"));
  EXPECT_TRUE(locomotion_metrics(gliding(2.02, {0.5, 0.0}, 0.0), *g1()).contains("speed_forward"));
}

// Two swings of the left foot by bending hip, knee and ankle: the mean of their heights.
TEST(Locomotion, SwingsAreMeasuredFootByFoot) {
  Recording recording = gliding(4.0, {0.0, 0.0}, 0.0);
  EXPECT_FALSE(locomotion_metrics(recording, *g1()).contains("swing_height"));
  const int knee = g1()->joint_index("left_knee_joint"), hip = g1()->joint_index("left_hip_pitch_joint");
  const auto swing = [&](int begin, double bend) {
    for (int t = begin; t < begin + 20; ++t) {
      recording.robot[t].q[knee] += bend;
      recording.robot[t].q[hip] -= 0.5 * bend;
    }
    return locomotion_metrics(recording, *g1()).at("swing_height");
  };
  const double high = swing(50, 0.6);
  EXPECT_GT(high, 0.05);
  EXPECT_LT(high, 0.12);
  const double mean = swing(120, 0.3), low = 2.0 * mean - high;  // of the two swings
  EXPECT_GT(low, 0.02);
  EXPECT_LT(low, 0.06);
  EXPECT_GT(locomotion_metrics(recording, *g1()).at("closest_feet"), 0.1);
}

TEST(Locomotion, TheUpperBodyIsWhatCarriesNoFoot) {
  Recording recording = gliding(4.0, {0.0, 0.0}, 0.0);
  const int knee = g1()->joint_index("left_knee_joint"), elbow = g1()->joint_index("left_elbow_joint");
  for (RobotState& state : recording.robot) state.q[knee] += 0.5;
  EXPECT_NEAR(locomotion_metrics(recording, *g1()).at("upper_body_error"), 0.0, 1e-12);
  for (RobotState& state : recording.robot) state.q[elbow] += 0.17;
  const auto metrics = locomotion_metrics(recording, *g1());
  EXPECT_NEAR(metrics.at("upper_body_error"), 0.17 / 17.0, 1e-12);  // 17 joints of waist and arms
  EXPECT_NEAR(metrics.at("upper_body_rate_error"), 0.0, 1e-12);
}

TEST(Locomotion, EveryFigureIsInTheCatalogue) {
  for (const auto& [name, value] : locomotion_metrics(gliding(4.0, {0.2, 0.0}, 0.0), *g1()))
    EXPECT_EQ(metric_info(name).group, MetricGroup::kEpisode) << name;
}

}  // namespace
}  // namespace duet
