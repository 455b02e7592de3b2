#include "duet/report/engines/cross_engine.h"

#include <gmock/gmock.h>

#include <algorithm>
#include <cmath>
#include <random>

#include "duet/core/require.h"
#include "duet/report/engines/cross_engine.h"
#include "tests/rows/rows.h"
#include "tests/support.h"

namespace duet {
namespace {

using test::engine_episode;
using test::thrown_message;
using test::traced;

using Rows = std::vector<EpisodeRow>;

// k of n episodes of one engine succeed, the first ones.
void add_rate(Rows& rows, const std::string& engine, const std::string& policy, int k, int n,
              const std::string& controller = "vmc") {
  for (int i = 0; i < n; ++i) rows.push_back(engine_episode(engine, policy, i, i < k, controller));
}

CrossEngineOptions few_resamples() { return {.intervals = {.resamples = 200}}; }

CrossEngine compared(const Rows& rows) { return cross_engine(rows, {}, few_resamples()); }

TEST(EngineSuccess, CountsPerEngineAndOverEngines) {
  Rows rows;
  add_rate(rows, "mujoco", "replay", 4, 6);
  add_rate(rows, "bullet", "replay", 5, 6);
  add_rate(rows, "ode", "replay", 3, 6);
  const CrossEngine result = compared(rows);
  ASSERT_EQ(result.success.size(), 1U);
  const EngineSuccess& success = result.success[0];
  ASSERT_EQ(success.engines.size(), 3U);
  EXPECT_EQ(success.engines[0].engine, "bullet");
  EXPECT_EQ(success.engines[0].k, 5);
  EXPECT_EQ(success.engines[0].n, 6);
  EXPECT_LE(success.engines[0].interval.low, wilson_of(2.0 * 5 / 6, 2).low);  // three draws of two clips
  EXPECT_DOUBLE_EQ(success.mean, 12.0 / 18.0);
  EXPECT_DOUBLE_EQ(success.sd, 1.0 / 6.0);  // of 5/6, 4/6, 3/6
  EXPECT_DOUBLE_EQ(success.range, 2.0 / 6.0);
  // p (1 - p) / 5 of the three: 5/180, 8/180, 9/180.
  EXPECT_DOUBLE_EQ(success.noise_sd, std::sqrt(22.0 / 180.0 / 3.0));
  EXPECT_EQ(success.excess_sd, 0.0);
  EXPECT_FALSE(success.playback.has_value());
}

TEST(EngineSuccess, SpreadBeyondChanceIsWhatIsLeftOfTheVariance) {
  Rows rows;
  add_rate(rows, "mujoco", "replay", 40, 50);
  add_rate(rows, "ode", "replay", 10, 50);
  const EngineSuccess success = compared(rows).success.at(0);
  EXPECT_DOUBLE_EQ(success.sd * success.sd, 0.18);                     // (0.8 - 0.2)^2 / 2
  EXPECT_DOUBLE_EQ(success.noise_sd * success.noise_sd, 0.16 / 49.0);  // both 0.16 / 49
  EXPECT_NEAR(success.excess_sd, std::sqrt(0.18 - 0.16 / 49.0), 1e-15);
}

TEST(EngineSuccess, AMeanOverEnginesIsNoSurerThanItsClipsAreMany) {
  // One engine succeeds where the other fails, so that every clip has the same mean: ten clips say no more for it.
  Rows rows;
  for (int i = 0; i < 30; ++i) {
    rows.push_back(engine_episode("mujoco", "replay", i, i < 15));
    rows.push_back(engine_episode("ode", "replay", i, i >= 15));
  }
  const EngineSuccess opposite = compared(rows).success.at(0);
  EXPECT_NEAR(opposite.mean_interval.low, wilson(5, 10).low, 1e-12);
  EXPECT_NEAR(opposite.mean_interval.high, wilson(5, 10).high, 1e-12);
  // Both succeed in the same clips: as wide as for one engine.
  for (EpisodeRow& row : rows) row.success = row.episode < 15;
  const EngineSuccess same = compared(rows).success.at(0);
  EXPECT_LT(same.mean_interval.low, 0.4);
  EXPECT_GT(same.mean_interval.high, 0.6);
}

TEST(EngineSuccess, OneClipSaysNothingOfOtherClips) {
  Rows rows;
  add_rate(rows, "mujoco", "replay", 2, 3);  // all of hug-0
  add_rate(rows, "ode", "replay", 1, 3);
  const EngineSuccess success = compared(rows).success.at(0);
  EXPECT_NEAR(success.mean_interval.low, wilson_of(0.5, 1).low, 1e-12);
  EXPECT_NEAR(success.mean_interval.high, wilson_of(0.5, 1).high, 1e-12);
}

TEST(EngineSuccess, IsOverTheEpisodesThatAllEnginesRan) {
  Rows rows;
  add_rate(rows, "mujoco", "replay", 4, 6);
  add_rate(rows, "ode", "replay", 4, 4);
  const EngineSuccess success = compared(rows).success.at(0);
  EXPECT_EQ(success.n, 4);
  EXPECT_EQ(success.left_out, 2);
  EXPECT_DOUBLE_EQ(success.mean, 1.0);
  Rows apart;
  apart.push_back(engine_episode("mujoco", "replay", 0, true));
  apart.push_back(engine_episode("ode", "replay", 1, true));
  const EngineSuccess none = compared(apart).success.at(0);
  EXPECT_EQ(none.n, 0);
  EXPECT_TRUE(std::isnan(none.mean));
  EXPECT_TRUE(std::isnan(none.mean_interval.low));
}

TEST(EngineSuccess, PlaybackIsApart) {
  Rows rows;
  add_rate(rows, "mujoco", "replay", 2, 6);
  add_rate(rows, "ode", "replay", 2, 6);
  add_rate(rows, "playback", "replay", 6, 6, "none");  // its controller does not matter
  const CrossEngine result = compared(rows);
  ASSERT_EQ(result.success.size(), 1U);
  EXPECT_DOUBLE_EQ(result.success[0].mean, 2.0 / 6.0);
  ASSERT_TRUE(result.success[0].playback.has_value());
  EXPECT_EQ(result.success[0].playback->k, 6);
  ASSERT_EQ(result.engines.size(), 2U);
  EXPECT_TRUE(result.has_playback);
  add_rate(rows, "playback", "replay", 1, 6, "vmc");  // the same controller comes first
  EXPECT_EQ(compared(rows).success.at(0).playback->k, 1);
}

TEST(EngineSuccess, OnlyTheArmAskedForCounts) {
  Rows rows;
  add_rate(rows, "mujoco", "replay", 4, 6);
  add_rate(rows, "ode", "replay", 4, 6);
  for (const char* engine : {"mujoco", "ode"}) {
    rows.push_back(engine_episode(engine, "null", 0, true));
    rows.back().arm = "null";
  }
  EXPECT_EQ(compared(rows).success.size(), 1U);
  CrossEngineOptions null_arm = few_resamples();
  null_arm.arm = "null";
  EXPECT_EQ(cross_engine(rows, {}, null_arm).success.at(0).policy, "null");
}

TEST(EngineSuccess, WhatDidNotEndWellFails) {
  Rows rows;
  add_rate(rows, "mujoco", "replay", 3, 3);
  add_rate(rows, "ode", "replay", 3, 3);
  rows[5].outcome = Outcome::kDiverged;
  EXPECT_EQ(compared(rows).success.at(0).engines.at(1).k, 2);
}

TEST(CrossEngineComparison, SaysVersionAndProfileOfEachEngine) {
  Rows rows;
  add_rate(rows, "mujoco", "replay", 1, 2);
  add_rate(rows, "ode", "replay", 1, 2);
  rows[0].engine_version = rows[1].engine_version = "2.2.2";
  rows[0].engine_profile = "parity";
  rows[1].engine_profile = "fast";
  const CrossEngine result = compared(rows);
  EXPECT_EQ(result.engines[0].name, "mujoco");
  EXPECT_EQ(result.engines[0].version, "2.2.2");
  EXPECT_EQ(result.engines[0].profile, "fast, parity");
  EXPECT_EQ(result.engines[1].version, "");
}

TEST(CrossEngineComparison, FewerThanTwoPhysicsEnginesHaveNoTables) {
  Rows rows;
  add_rate(rows, "mujoco", "replay", 4, 6);
  add_rate(rows, "playback", "replay", 6, 6);
  const CrossEngine one = compared(rows);
  EXPECT_EQ(one.engines.size(), 1U);
  EXPECT_TRUE(one.success.empty() && one.ranks.empty() && one.drift.empty() && one.parting.empty());
  EXPECT_TRUE(compared({}).engines.empty());
}

TEST(CrossEngineComparison, RefusesMixedSuitesAndEpisodesThatAreThereTwice) {
  Rows rows = {engine_episode("mujoco", "replay", 0, true), engine_episode("ode", "replay", 0, true)};
  rows[1].suite_version = "2.0.0";
  EXPECT_SENTENCE(thrown_message<InputError>([&] { compared(rows); }));
  rows[1] = rows[0];
  EXPECT_SENTENCE(thrown_message<InputError>([&] { compared(rows); }));
}

Estimate rank_of(const Estimates& ranks, const char* of, const char* engines, const char* name) {
  return *find_estimate(ranks, {.engine = engines, .of = of, .name = name});
}

TEST(RankStability, CountsSwapsAndTau) {
  Rows rows;
  // Success of policies a, b, c: 1, 2, 3 of 4 in mujoco; 1, 3, 2 in ode; 3, 2, 1 in bullet.
  for (const auto& [engine, a, b, c] : {std::tuple("mujoco", 1, 2, 3), {"ode", 1, 3, 2}, {"bullet", 3, 2, 1}}) {
    add_rate(rows, engine, "a", a, 4);
    add_rate(rows, engine, "b", b, 4);
    add_rate(rows, engine, "c", c, 4);
  }
  const Estimates ranks = compared(rows).ranks;
  EXPECT_THAT(values_of(ranks, &Estimate::of), testing::ElementsAre("combinations"));  // one controller
  const auto of = [&](const char* engines, const char* name) { return rank_of(ranks, "combinations", engines, name); };
  EXPECT_EQ(of("all", "items").value, 3.0);
  EXPECT_EQ(of("bullet vs mujoco", "swapped").value, 3.0);
  EXPECT_DOUBLE_EQ(of("bullet vs mujoco", "tau_b").value, -1.0);
  EXPECT_DOUBLE_EQ(of("bullet vs ode", "tau_b").value, -1.0 / 3.0);  // only b and c in the same order
  EXPECT_DOUBLE_EQ(of("mujoco vs ode", "tau_b").value, 1.0 / 3.0);
  EXPECT_EQ(of("mujoco vs ode", "swapped").value, 1.0);
  EXPECT_DOUBLE_EQ(of("all", "mean_tau_b").value, -1.0 / 3.0);
  EXPECT_EQ(of("all", "swapped").n, 3);
  EXPECT_EQ(of("all", "swapped").value, 3.0);
}

TEST(RankStability, OfControllersAndPoliciesAloneIsOfTheirMeans) {
  Rows rows;
  // mujoco: x/a 4, x/b 2, y/a 3, y/b 1 of 4; ode: x/a 1, x/b 3, y/a 2, y/b 4.
  const auto add = [&](const char* engine, int xa, int xb, int ya, int yb) {
    add_rate(rows, engine, "a", xa, 4, "x");
    add_rate(rows, engine, "b", xb, 4, "x");
    add_rate(rows, engine, "a", ya, 4, "y");
    add_rate(rows, engine, "b", yb, 4, "y");
  };
  add("mujoco", 4, 2, 3, 1);
  add("ode", 3, 1, 4, 2);
  const Estimates ranks = compared(rows).ranks;
  EXPECT_THAT(values_of(ranks, &Estimate::of), testing::ElementsAre("combinations", "controllers", "policies"));
  EXPECT_EQ(rank_of(ranks, "combinations", "all", "items").value, 4.0);
  // Two of six pairs are swapped: those between controllers for one policy.
  EXPECT_EQ(rank_of(ranks, "combinations", "mujoco vs ode", "swapped").value, 2.0);
  EXPECT_DOUBLE_EQ(rank_of(ranks, "combinations", "all", "mean_tau_b").value, 2.0 / 6.0);
  // x 6, y 4 in mujoco; x 4, y 6 in ode
  EXPECT_DOUBLE_EQ(rank_of(ranks, "controllers", "all", "mean_tau_b").value, -1.0);
  EXPECT_DOUBLE_EQ(rank_of(ranks, "policies", "all", "mean_tau_b").value, 1.0);  // a 7, b 3 in both
}

TEST(RankStability, IsNotDefinedForOneCombinationOrTiesThroughout) {
  Rows rows;
  add_rate(rows, "mujoco", "a", 1, 4);
  add_rate(rows, "ode", "a", 2, 4);
  const auto of = [&](const char* engines, const char* name) {
    return rank_of(compared(rows).ranks, "combinations", engines, name);
  };
  EXPECT_TRUE(std::isnan(of("all", "mean_tau_b").value));
  EXPECT_EQ(of("all", "items").value, 1.0);
  add_rate(rows, "mujoco", "b", 1, 4);
  add_rate(rows, "ode", "b", 3, 4);
  EXPECT_EQ(of("all", "items").value, 2.0);
  EXPECT_EQ(of("all", "mean_tau_b").n, 0);
  EXPECT_TRUE(std::isnan(of("mujoco vs ode", "tau_b").value));
  EXPECT_EQ(of("all", "swapped").value, 0.0);
}

TEST(RankStability, MeanMaximumRankViolationIsThatOfSimpler) {
  const std::vector<double> reference = {0.9, 0.6, 0.5};
  EXPECT_EQ(mean_maximum_rank_violation(reference, std::vector<double>{0.3, 0.2, 0.1}), 0.0);
  // The last two are the other way round: each is .1 off.
  EXPECT_NEAR(mean_maximum_rank_violation(reference, std::vector<double>{0.3, 0.1, 0.2}), 0.2 / 3.0, 1e-12);
  // All reversed: .4, .3 and .4.
  EXPECT_NEAR(mean_maximum_rank_violation(reference, std::vector<double>{0.1, 0.2, 0.3}), 1.1 / 3.0, 1e-12);
  // Tied in the other engine: an item is violated by those above it in the reference alone.
  EXPECT_NEAR(mean_maximum_rank_violation(reference, std::vector<double>{0.1, 0.1, 0.1}), 0.7 / 3.0, 1e-12);
  EXPECT_EQ(mean_maximum_rank_violation(std::vector<double>{0.5, 0.5}, std::vector<double>{0.2, 0.7}), 0.0);
  EXPECT_SENTENCE(test::thrown_message<std::invalid_argument>(
      [&] { mean_maximum_rank_violation(reference, std::vector<double>{0.1}); }));
}

TEST(RankStability, TheWinnerChangesWhereTheBestAreNotTheSame) {
  const std::vector<double> first = {0.9, 0.6};
  EXPECT_EQ(winner_change(first, std::vector<double>{0.5, 0.4}), 0.0);
  EXPECT_EQ(winner_change(first, std::vector<double>{0.4, 0.5}), 1.0);
  // Ties are ties, no coin to toss.
  EXPECT_EQ(winner_change(first, std::vector<double>{0.5, 0.5}), 0.0);
  EXPECT_EQ(winner_change(std::vector<double>{0.5, 0.5}, std::vector<double>{0.5, 0.5}), 0.0);
  EXPECT_EQ(winner_change(std::vector<double>{0.9, 0.9, 0.1}, std::vector<double>{0.2, 0.3, 0.4}), 1.0);
  EXPECT_SENTENCE(test::thrown_message<std::invalid_argument>([&] { winner_change(first, std::vector<double>{}); }));
}

TEST(RankStability, FiguresHaveIntervalsThatDrawClipsAgain) {
  Rows rows;
  for (const auto& [engine, a, b] : {std::tuple("mujoco", 9, 3), {"ode", 4, 8}}) {
    add_rate(rows, engine, "a", a, 12);
    add_rate(rows, engine, "b", b, 12);
  }
  const auto of = [&](const char* name) { return rank_of(compared(rows).ranks, "combinations", "all", name); };
  const Estimate violation = of("rank_violation");
  EXPECT_NEAR(violation.value, 0.5 * (6.0 / 12.0 + 4.0 / 12.0), 1e-12);
  EXPECT_EQ(of("winner_changes").value, 1.0);
  EXPECT_EQ(of("mean_tau_b").value, -1.0);
  EXPECT_LE(violation.interval.low, violation.value);
  EXPECT_GE(violation.interval.high, violation.value);
  EXPECT_LT(violation.interval.low, violation.interval.high);
  EXPECT_GE(of("mean_tau_b").interval.low, -1.0);
  EXPECT_LE(of("winner_changes").interval.high, 1.0);
  EXPECT_EQ(of("rank_violation").interval.low, violation.interval.low);
  std::reverse(rows.begin(), rows.end());
  EXPECT_EQ(of("rank_violation").interval.low, violation.interval.low);
  rows.clear();
  add_rate(rows, "mujoco", "a", 1, 4);
  add_rate(rows, "ode", "a", 2, 4);
  EXPECT_TRUE(std::isnan(of("rank_violation").value));
  EXPECT_TRUE(std::isnan(of("rank_violation").interval.low));
}

TEST(MetricDrift, IsEngineMinusPlaybackInTheSameEpisode) {
  Rows rows;
  for (int i = 0; i < 6; ++i) {
    rows.push_back(engine_episode("playback", "replay", i, true, "none"));
    rows.back().metrics = {{"jpe", 0.1 * i}};
    rows.push_back(engine_episode("mujoco", "replay", i, true));
    rows.back().metrics = {{"jpe", 0.1 * i + (i < 3 ? 0.01 : 0.03)}, {"awd", 1.0}};
    rows.push_back(engine_episode("ode", "replay", i, true));
    if (i < 2) rows.back().metrics = {{"jpe", 0.1 * i - 0.5}};
  }
  rows.push_back(engine_episode("mujoco", "replay", 9, true));  // playback lacks it
  rows.back().metrics = {{"jpe", 99.0}};
  rows.push_back(engine_episode("mujoco", "other", 0, true));
  rows.back().metrics = {{"jpe", 99.0}};
  const Estimates drift =
      cross_engine(rows, {{"awd", "", "m", "lower"}, {"jpe", "", "m", "lower"}}, few_resamples()).drift;
  EXPECT_THAT(values_of(drift, &Estimate::of), testing::ElementsAre("jpe"));  // playback has no awd
  EXPECT_THAT(values_of(drift, &Estimate::engine), testing::ElementsAre("mujoco", "ode"));
  const auto of = [&](const char* engine, const char* name) {
    return *find_estimate(drift, {.engine = engine, .controller = "vmc", .of = "jpe", .name = name});
  };
  EXPECT_EQ(of("mujoco", "drift").n, 6);
  EXPECT_EQ(of("mujoco", "drift").unit, "m");
  EXPECT_NEAR(of("mujoco", "drift").value, 0.02, 1e-15);
  EXPECT_NEAR(of("mujoco", "playback").value, 0.25, 1e-15);
  // Two clips, one with 0.01 throughout, one with 0.03: one in four resamples has only the one or only the other.
  EXPECT_NEAR(of("mujoco", "drift").interval.low, 0.01, 1e-15);
  EXPECT_NEAR(of("mujoco", "drift").interval.high, 0.03, 1e-15);
  EXPECT_EQ(of("ode", "drift").n, 2);
  EXPECT_NEAR(of("ode", "drift").value, -0.5, 1e-15);
}

TEST(ForceAgreement, IsPerEpisodeAndThenTheMedian) {
  Rows rows;
  const auto add = [&](int number, std::initializer_list<std::pair<const char*, double>> in_engine) {
    for (const auto& [engine, value] : in_engine) {
      rows.push_back(engine_episode(engine, "replay", number, true));
      rows.back().forces = {{"human.peak_n", value}, {"human.limits_verified", 1.0}};
    }
  };
  add(0, {{"mujoco", 100.0}, {"ode", 110.0}, {"bullet", 90.0}});   // spread 0.2, median 100
  add(1, {{"mujoco", 100.0}, {"ode", 100.0}, {"bullet", 130.0}});  // spread 30 / 110, median 100
  add(2, {{"mujoco", 0.0}, {"ode", 0.0}, {"bullet", 0.0}});
  add(3, {{"mujoco", 500.0}});
  add(4, {{"mujoco", 0.0}, {"ode", 0.0}, {"bullet", 300.0}});  // spread 3, median 0: no ratio
  rows[0].forces["ground.mean_n"] = 343.0;                     // in one engine only
  const Estimates forces = compared(rows).forces;
  EXPECT_THAT(values_of(forces, &Estimate::of), testing::ElementsAre("human.peak_n"));
  const auto of = [&](const char* engine, const char* name) {
    return *find_estimate(forces, {.engine = engine, .of = "human.peak_n", .name = name});
  };
  EXPECT_EQ(of("all", "typical_force").unit, "N");
  EXPECT_EQ(of("all", "typical_force").n, 3);
  EXPECT_DOUBLE_EQ(of("all", "typical_force").value, 100.0);
  EXPECT_DOUBLE_EQ(of("all", "force_spread").value, 30.0 / 110.0);
  EXPECT_DOUBLE_EQ(of("mujoco", "force_ratio").value, 1.0);
  EXPECT_DOUBLE_EQ(of("ode", "force_ratio").value, 1.05);
  EXPECT_DOUBLE_EQ(of("bullet", "force_ratio").value, 1.1);
}

TEST(ForceUnit, IsTheEndingOfTheName) {
  EXPECT_EQ(force_unit("human.chest.peak_n"), "N");
  EXPECT_EQ(force_unit("human.impulse_ns"), "N s");
  EXPECT_EQ(force_unit("human.contact_s"), "s");
  EXPECT_EQ(force_unit("human.chest.pressure_n_cm2"), "N/cm^2");
  EXPECT_EQ(force_unit("human.count"), "");
}

TEST(CrossEngineComparison, DoesNotDependOnTheOrderOfRows) {
  Rows rows;
  std::mt19937 random(7);
  for (const char* engine : {"ode", "mujoco", "bullet", "playback"}) {
    for (const char* policy : {"a", "b"}) {
      for (int i = 0; i < 9; ++i) {
        rows.push_back(traced(engine, i, {0, static_cast<int>(random() % 90), 0}));
        rows.back().policy = policy;
        rows.back().success = random() % 3 != 0;
        rows.back().metrics = {{"jpe", 1e-3 * static_cast<double>(random() % 1000)}};
        rows.back().forces = {{"human.peak_n", static_cast<double>(random() % 100)}};
      }
    }
  }
  const std::vector<MetricColumn> metrics = {{"jpe", "", "m", "lower"}};
  const nlohmann::json before = analysis_json(engine_analysis(cross_engine(rows, metrics, few_resamples())));
  EXPECT_EQ(analysis_json(engine_analysis(cross_engine(rows, metrics, few_resamples()))), before);
  std::shuffle(rows.begin(), rows.end(), random);
  EXPECT_EQ(analysis_json(engine_analysis(cross_engine(rows, metrics, few_resamples()))), before);
}

}  // namespace
}  // namespace duet
