#include <gmock/gmock.h>

#include <cmath>

#include "duet/core/require.h"
#include "duet/rollout/perturbations/partner_perturbation.h"
#include "duet/rollout/perturbations/perturbation.h"
#include "tests/backends/allocation_count.h"
#include "tests/experiment/fixtures.h"
#include "tests/support.h"

namespace duet {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using Joints = Perception::Joints;

// A partner whose joints all stand at their index along x and move by one a tick along y.
Joints at_tick(int tick) {
  Joints joints = Joints::Zero();
  for (int j = 0; j < joints.cols(); ++j) joints.col(j) = Eigen::Vector3d(j, tick, 1.0);
  return joints;
}

// The partner as it is seen over so many ticks.
std::vector<Joints> watch(const PerceptionPlan& plan, int ticks, std::uint64_t seed = 5) {
  Perception perception(plan, seed);
  std::vector<Joints> seen;
  for (int t = 0; t < ticks; ++t) seen.push_back(perception.seen(t, at_tick(t)));
  return seen;
}

TEST(Perception, WithoutAPlanThePartnerIsSeenToTheBit) {
  const std::vector<Joints> seen = watch({}, 5);
  for (int t = 0; t < 5; ++t) EXPECT_EQ(seen[t], at_tick(t));
}

TEST(Perception, JitterHasItsDeviationAndNoMean) {
  PerceptionPlan plan;
  plan.jitter = 0.05;
  constexpr int kTicks = 200;
  const std::vector<Joints> seen = watch(plan, kTicks);
  double sum = 0.0, square = 0.0;
  for (int t = 0; t < kTicks; ++t) {
    sum += (seen[t] - at_tick(t)).sum();
    square += (seen[t] - at_tick(t)).squaredNorm();
  }
  const double n = kTicks * 72.0;
  EXPECT_NEAR(sum / n, 0.0, 4.0 * 0.05 / std::sqrt(n));
  EXPECT_NEAR(std::sqrt(square / n), 0.05, 4.0 * 0.05 / std::sqrt(2.0 * n));
}

TEST(Perception, ADroppedJointKeepsItsLastSeenPlace) {
  PerceptionPlan plan;
  plan.dropout = 0.3;
  constexpr int kTicks = 300;
  const std::vector<Joints> seen = watch(plan, kTicks);
  EXPECT_EQ(seen[0], at_tick(0));  // a first look there is
  int dropped = 0;
  for (int t = 1; t < kTicks; ++t) {
    for (int j = 0; j < 24; ++j) {
      if (seen[t].col(j) == at_tick(t).col(j)) continue;
      EXPECT_EQ(seen[t].col(j), seen[t - 1].col(j));
      ++dropped;
    }
  }
  const double n = 24.0 * (kTicks - 1);
  EXPECT_NEAR(dropped / n, 0.3, 4.0 * std::sqrt(0.3 * 0.7 / n));
}

TEST(Perception, LatencyShowsThePast) {
  PerceptionPlan plan;
  plan.latency_ms = 100.0;
  const std::vector<Joints> seen = watch(plan, 20);
  for (int t = 0; t < 20; ++t) EXPECT_EQ(seen[t], at_tick(std::max(0, t - 5))) << t;
}

TEST(Perception, AVanishedPartnerStaysWhereItWasLastSeen) {
  PerceptionPlan plan;
  plan.vanish = 0.2;
  plan.jitter = 0.01;
  const std::vector<Joints> seen = watch(plan, 30);
  EXPECT_NE(seen[9], seen[8]);
  for (int t = 10; t < 30; ++t) EXPECT_EQ(seen[t], seen[9]) << t;
}

TEST(Perception, AFreezeEnds) {
  PerceptionPlan plan;
  plan.freeze = PerceptionFreeze{0.2, 0.1};
  const std::vector<Joints> seen = watch(plan, 20);
  for (int t = 0; t < 20; ++t) EXPECT_EQ(seen[t], at_tick(t >= 10 && t < 15 ? 9 : t)) << t;
}

TEST(Perception, AJumpMovesEveryJointLevelByOneVector) {
  PerceptionPlan plan;
  plan.jump = PerceptionJump{0.2, 0.3};
  const std::vector<Joints> seen = watch(plan, 20);
  EXPECT_EQ(seen[9], at_tick(9));
  const Eigen::Vector3d jump = seen[10].col(0) - at_tick(10).col(0);
  constexpr double kRounding = 1e-13;
  EXPECT_NEAR(jump.norm(), 0.3, kRounding);
  EXPECT_EQ(jump.z(), 0.0);
  for (int t = 10; t < 20; ++t)
    for (int j = 0; j < 24; ++j) EXPECT_NEAR((seen[t].col(j) - at_tick(t).col(j) - jump).norm(), 0.0, kRounding);
  EXPECT_NE(watch(plan, 20, 6)[10], seen[10]);
}

TEST(Perception, TheSameSeedGivesTheSameView) {
  PerceptionPlan plan;
  plan.jitter = 0.02;
  plan.dropout = 0.1;
  EXPECT_EQ(watch(plan, 20), watch(plan, 20));
  EXPECT_NE(watch(plan, 20), watch(plan, 20, 6));
}

TEST(Perception, AllocatesNothingOnceItIsMade) {
  PerceptionPlan plan;
  plan.jitter = 0.02;
  plan.dropout = 0.1;
  plan.latency_ms = 200.0;
  plan.vanish = 0.5;
  Perception perception(plan, 1);
  const Joints joints = at_tick(0);
  if (!test::allocations_are_counted()) GTEST_SKIP() << "not run: allocations are not counted under the sanitizer";
  const long before = test::allocation_count();
  for (int t = 0; t < 50; ++t) perception.seen(t, joints);
  EXPECT_EQ(test::allocation_count(), before);
}

std::vector<Perturbation> read(const std::string& list) {
  return parse_suite(
             "schema: duet.suite/1\nname: p\nversion: 1.0.0\nclips: {synth: {per_task: 1}}\nengines: [playback]\n"
             "controllers: [pd]\npolicies: [replay]\nperturbations: " +
                 list + "\n",
             "p.yaml")
      .perturbations;
}

std::string refusal(const std::string& list) {
  return test::thrown_message<InputError>([&] { read(list); });
}

TEST(Perception, NamesAloneHaveTheDocumentedDefaults) {
  const std::vector<Perturbation> list = read("[jitter, dropout, perception_latency, vanish, freeze, jump]");
  EXPECT_EQ(list[0].perception.jitter, 0.02);
  EXPECT_EQ(list[1].perception.dropout, 0.1);
  EXPECT_EQ(list[2].perception.latency_ms, 200.0);
  EXPECT_EQ(list[3].perception.vanish, 2.0);
  EXPECT_EQ(list[4].perception.freeze->duration, 1.0);
  EXPECT_EQ(list[5].perception.jump->metres, 0.3);
  EXPECT_EQ(list[0].perception.dropout, 0.0);
}

TEST(Perception, WrittenOutItReadsBackToTheSame) {
  const std::string once = to_yaml(
      read("[{name: all, jitter: {sigma: 0.01}, dropout: {p: 0.2}, perception_latency: {ms: 50}, vanish: {at: 4}, "
           "freeze: {at: 1, for: 0.5}, jump: {at: 0, metres: 1}}]")[0]);
  EXPECT_THAT(once, AllOf(HasSubstr("sigma: 0.01"), HasSubstr("for: 0.5")));
  EXPECT_EQ(to_yaml(read("[" + once + "]")[0]), once);
}

TEST(Perception, WhatIsWrongIsNamedWithItsLine) {
  for (const char* text :
       {"[{jitter: {sigma: 0}}]", "[{jitter: {sigam: 1}}]", "[{dropout: {p: 1.5}}]", "[{perception_latency: {ms: -1}}]",
        "[{vanish: {at: -1}}]", "[{freeze: {at: 1, for: 0}}]", "[{jump: {metres: x}}]", "[{jump: 3}]"})
    EXPECT_SENTENCE(refusal(text));
}

}  // namespace
}  // namespace duet
