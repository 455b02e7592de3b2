#include "duet/training/wbc_environment.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

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
  EXPECT_THAT([] { wbc_stage("run"); }, testing::ThrowsMessage<std::invalid_argument>(testing::HasSubstr("interact")));
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
  for (const double sum : {sums.root_xy, sums.heading, sums.upper_body, sums.joints}) EXPECT_GT(sum, 0.0);
  EXPECT_EQ(environment.take_statistics().joints, 0.0);
}

}  // namespace
}  // namespace duet
