#include "duet/training/wbc_environment.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "duet/core/robot_state.h"
#include "tests/training/fixtures.h"

namespace duet {
namespace {

using test::g1;

class WbcEnvironmentInMujoco : public test::InMujoco {};

TEST_F(WbcEnvironmentInMujoco, SizesAreTheSupplements) {
  const WbcEnvironment environment(g1(), wbc_stage("stand"), 1, 0);
  EXPECT_EQ(environment.actor_size(), 163);
  EXPECT_EQ(environment.critic_size(), 361);
  EXPECT_EQ(environment.actions(), 29);
}

TEST_F(WbcEnvironmentInMujoco, SeedAndIndexDecideEverything) {
  WbcTask task = wbc_stage("interact");
  task.stream.motions = 0.0;
  WbcEnvironment a(g1(), task, 1, 3), b(g1(), task, 1, 3), c(g1(), task, 1, 4);
  const std::vector<float> action(29, 0.1F);
  std::vector<float> oa(163), ob(163), oc(163), critic(361);
  for (int t = 0; t < 60; ++t) {
    const Transition ta = a.step(action), tb = b.step(action);
    c.step(action);
    ASSERT_EQ(ta.reward, tb.reward);
    if (ta.end != EpisodeEnd::kNone) {
      a.reset();
      b.reset();
      c.reset();
    }
  }
  a.observe(oa, critic);
  b.observe(ob, critic);
  c.observe(oc, critic);
  EXPECT_EQ(oa, ob);
  EXPECT_NE(oa, oc);
}

TEST_F(WbcEnvironmentInMujoco, WithoutAControllerItFallsWithinTwoSeconds) {
  WbcTask task = wbc_stage("stand");
  task.domain.kick = 0.0;
  WbcEnvironment environment(g1(), task, 1, 0);
  const std::vector<float> nothing(29, 0.0F);
  Transition transition;
  while (transition.end == EpisodeEnd::kNone) transition = environment.step(nothing);
  EXPECT_EQ(transition.end, EpisodeEnd::kFell);
  EXPECT_LT(environment.tick(), 100);
  EXPECT_LT(transition.reward, -1.0);  // -100 per second over one tick, and what it had earned
}

TEST_F(WbcEnvironmentInMujoco, AnActionThatIsNotANumberIsNoAction) {
  WbcEnvironment environment(g1(), wbc_stage("stand"), 1, 0);
  const std::vector<float> action(29, std::nanf(""));
  const Transition transition = environment.step(action);
  EXPECT_TRUE(std::isfinite(transition.reward));
  EXPECT_EQ(environment.action().squaredNorm(), 0.0F);
}

TEST_F(WbcEnvironmentInMujoco, TimeEndsAnEpisodeOfFiveHundredTicks) {
  WbcEnvironment environment(g1(), wbc_stage("stand"), 1, 0);
  environment.skip_to(499);
  EXPECT_EQ(environment.step(std::vector<float>(29, 0.0F)).end, EpisodeEnd::kTimeUp);
}

TEST(WbcTask, AnUnknownStageIsRefusedWithTheKnownOnes) {
  EXPECT_SENTENCE(test::thrown_message<std::invalid_argument>([] { wbc_stage("run"); }));
}

TEST_F(WbcEnvironmentInMujoco, TimeIsUpAfterTheTicksOfTheTaskAndNoSooner) {
  WbcTask task = wbc_stage("stand");
  task.domain.kick = 0.0;
  task.episode_ticks = 5;
  WbcEnvironment environment(g1(), task, 1, 0);
  const std::vector<float> nothing(29, 0.0F);
  for (int tick = 1; tick < 5; ++tick) EXPECT_EQ(environment.step(nothing).end, EpisodeEnd::kNone) << tick;
  EXPECT_EQ(environment.step(nothing).end, EpisodeEnd::kTimeUp);
}

// Sums of magnitudes since they were taken last: none is below 0, and a robot that sways has some of each.
TEST(WbcTask, AFootThatSwingsTooLowCostsMoreThanOneTooHigh) {
  EXPECT_EQ(lift_cost(0.0), 0.0);
  EXPECT_DOUBLE_EQ(lift_cost(-0.05), 0.0025);
  EXPECT_DOUBLE_EQ(lift_cost(0.05), 0.3 * 0.0025);
}

TEST_F(WbcEnvironmentInMujoco, TrackingErrorsAreSumsOfMagnitudes) {
  WbcTask task = wbc_stage("stand");
  task.domain.kick = 0.0;
  WbcEnvironment environment(g1(), task, 1, 0);
  const std::vector<float> action(29, 0.2F);
  for (int tick = 0; tick < 10; ++tick) environment.step(action);
  const TrackingStatistics sums = environment.take_statistics();
  for (const double sum : {sums.root_xy, sums.heading, sums.upper_body, sums.joints, sums.action_rate})
    EXPECT_GT(sum, 0.0);
  EXPECT_EQ(environment.take_statistics().joints, 0.0);
}

// A robot that sways, for which nothing is rewarded or costs but what the test adds.
WbcTask unrewarded() {
  WbcTask task = wbc_stage("stand");
  task.domain.kick = 0.0;
  RewardWeights& w = task.reward;
  for (double* weight : {&w.root_xy,  &w.root_near,   &w.upper_body,  &w.hands,       &w.joints,   &w.height,
                         &w.attitude, &w.velocity,    &w.clock,       &w.lift,        &w.foothold, &w.both_feet,
                         &w.stance,   &w.action_rate, &w.action_jerk, &w.action,      &w.torque,   &w.limits,
                         &w.slip,     &w.spin,        &w.joint_speed, &w.self_contact})
    *weight = 0.0;
  return task;
}

TEST_F(WbcEnvironmentInMujoco, ARewardFallsOffWithTheSquareOfTheErrorOverItsWidth) {
  WbcTask task = unrewarded();
  task.reward.root_xy = 2.0;
  task.reward.root_xy_width = 0.03;
  WbcEnvironment environment(g1(), task, 1, 0);
  for (int tick = 0; tick < 10; ++tick) {
    const double reward = environment.step(std::vector<float>(29, 0.2F)).reward;
    const double error = environment.take_statistics().root_xy;
    EXPECT_GT(error, 0.0);
    EXPECT_NEAR(reward, kTick * 2.0 * std::exp(-std::pow(error / 0.03, 2)), 1e-12);
  }
}

TEST_F(WbcEnvironmentInMujoco, TheErrorOfTheJointsIsTheirMean) {
  WbcTask task = unrewarded();
  task.reward.joints = 1.0;
  WbcEnvironment environment(g1(), task, 1, 0);
  const double reward = environment.step(std::vector<float>(29, 0.2F)).reward;
  const double rms = task.reward.joints_width * std::sqrt(-std::log(reward / kTick));
  const double mean = environment.take_statistics().joints;
  EXPECT_LE(mean, rms * (1.0 + 1e-9));
  EXPECT_GE(mean, rms / std::sqrt(29.0));  // no fewer: one joint has all of it
}

// How far the robot is from its reference, mean over half a second [m].
double distance_when(const WbcTask& task) {
  WbcEnvironment environment(g1(), task, 1, 0);
  for (int tick = 0; tick < 25; ++tick) environment.step(std::vector<float>(29, 0.0F));
  const TrackingStatistics sums = environment.take_statistics();
  return sums.root_xy / static_cast<double>(sums.ticks);
}

TEST_F(WbcEnvironmentInMujoco, OnlyTheShareOfEpisodesAskedForIsPushed) {
  WbcTask task = unrewarded();
  task.domain.push = 300.0;
  task.domain.push_pause = 0.02;
  task.domain.push_share = 0.0;
  const double alone = distance_when(task);
  task.domain.push_share = 1.0;
  EXPECT_GT(distance_when(task), 3.0 * alone);
}

TEST_F(WbcEnvironmentInMujoco, AnEpisodeWithPushesHasNoKicks) {
  for (int index = 0; index < 30; ++index) {  // the first kick is drawn between 0.5 and 4 s
    WbcTask task = unrewarded();
    task.reward.root_xy = 1.0;
    task.domain.push = 1e-9;
    task.domain.kick_from = task.domain.kick_to = 0.1;
    WbcEnvironment still(g1(), task, 1, index);
    task.domain.kick = 5.0;
    WbcEnvironment kicked(g1(), task, 1, index);
    const std::vector<float> nothing(29, 0.0F);
    for (int tick = 0; tick < 45; ++tick) ASSERT_EQ(kicked.step(nothing).reward, still.step(nothing).reward) << tick;
  }
}

TEST_F(WbcEnvironmentInMujoco, AnEpisodeEndsWhereTheRobotIsTooFarFromItsReference) {
  for (const double farthest : {1.0, 0.005}) {
    WbcTask task = unrewarded();
    task.farthest = farthest;
    WbcEnvironment environment(g1(), task, 1, 0);
    EpisodeEnd end = EpisodeEnd::kNone;
    for (int tick = 0; tick < 20 && end == EpisodeEnd::kNone; ++tick)
      end = environment.step(std::vector<float>(29, 0.2F)).end;
    EXPECT_EQ(end, farthest < 0.1 ? EpisodeEnd::kFell : EpisodeEnd::kNone);
  }
}

TEST_F(WbcEnvironmentInMujoco, AReferenceThatJumpsDoesSoFiveTimesASecond) {
  WbcTask task = unrewarded();
  task.domain.jump = 0.2;
  task.domain.jump_share = 1.0;
  WbcEnvironment environment(g1(), task, 1, 0);
  Eigen::Vector3d before = environment.sensors().root_error;
  for (int tick = 1; tick <= 30; ++tick) {
    environment.step(std::vector<float>(29, 0.0F));
    const double moved = (environment.sensors().root_error - before).norm();
    before = environment.sensors().root_error;
    EXPECT_EQ(moved > 0.03, tick % 10 == 0) << "tick " << tick << ": " << moved;
  }
}

TEST_F(WbcEnvironmentInMujoco, FeetThatSlipOnTheGroundCost) {
  WbcTask task = unrewarded();
  task.reward.slip = 1.0;
  WbcEnvironment environment(g1(), task, 1, 0);
  double sum = 0.0;
  for (int tick = 0; tick < 10; ++tick) sum += environment.step(std::vector<float>(29, 0.2F)).reward;
  EXPECT_LT(sum, 0.0);
}

}  // namespace
}  // namespace duet
