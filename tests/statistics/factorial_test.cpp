#include "duet/statistics/factorial.h"

#include <gmock/gmock.h>

#include <bit>
#include <cmath>
#include <numeric>

#include "duet/core/numbers.h"
#include "tests/support.h"

namespace duet {
namespace {

constexpr double kAlgebra = 1e-12;

Contrast sum_of(const std::vector<Contrast>& contrasts) {
  Contrast sum(contrasts.front().size(), 0.0);
  for (const Contrast& contrast : contrasts)
    for (std::size_t i = 0; i < sum.size(); ++i) sum[i] += contrast[i];
  return sum;
}

void expect_equal(const Contrast& a, const Contrast& b) {
  ASSERT_EQ(a.size(), b.size());
  for (std::size_t i = 0; i < a.size(); ++i) EXPECT_NEAR(a[i], b[i], kAlgebra) << "cell " << i;
}

// Every episode of a cell succeeds with the cell's chance; an episode a clip.
FactorialOutcomes drawn(const std::vector<double>& chances, int episodes, std::uint64_t seed) {
  FactorialOutcomes outcomes{.switches = static_cast<int>(std::bit_width(chances.size())) - 1,
                             .cells = std::vector<std::vector<double>>(chances.size()),
                             .clips = {}};
  Random random(seed, stream_key({"factorial test"}));
  for (int i = 0; i < episodes; ++i) {
    outcomes.clips.push_back(i);
    const double luck = random.uniform();
    for (std::size_t cell = 0; cell < chances.size(); ++cell)
      outcomes.cells[cell].push_back(luck < chances[cell] ? 1.0 : 0.0);
  }
  return outcomes;
}

TEST(Factorial, EffectsOfAllSetsSumToTheGap) {
  for (int switches = 1; switches <= kMostSwitches; ++switches) {
    std::vector<Contrast> all;
    for (unsigned set = 1; set < 1U << static_cast<unsigned>(switches); ++set)
      all.push_back(together_contrast(switches, set));
    expect_equal(sum_of(all), gap_contrast(switches));
  }
}

TEST(Factorial, ShapleyValuesSumToTheGapAndShareEachEffectAlike) {
  for (int switches = 1; switches <= kMostSwitches; ++switches) {
    std::vector<Contrast> all;
    for (int i = 0; i < switches; ++i) {
      all.push_back(shapley_contrast(switches, i));
      std::vector<Contrast> parts;
      for (unsigned set = 1; set < 1U << static_cast<unsigned>(switches); ++set) {
        if ((set >> static_cast<unsigned>(i) & 1U) == 0) continue;
        parts.push_back(together_contrast(switches, set));
        for (double& weight : parts.back()) weight /= std::popcount(set);
      }
      expect_equal(sum_of(parts), all.back());
    }
    expect_equal(sum_of(all), gap_contrast(switches));
  }
}

TEST(Factorial, TwoSwitchesThatActOnlyTogetherAreNotBlamedAlone) {
  // The review's table: 100, 100, 100 and 36.7 % of 30.
  FactorialOutcomes outcomes{.switches = 2, .cells = std::vector<std::vector<double>>(4), .clips = {}};
  for (int i = 0; i < 30; ++i) {
    outcomes.clips.push_back(i);
    for (std::size_t cell = 0; cell < 4; ++cell) outcomes.cells[cell].push_back(cell < 3 || i < 11 ? 1.0 : 0.0);
  }
  ClusterBootstrap bootstrap(2000, 1);
  const IntervalOptions options{.resamples = 2000};
  const auto value = [&](const Contrast& contrast) { return contrast_value(outcomes, contrast, options, bootstrap); };
  const double gap = -19.0 / 30.0;
  EXPECT_EQ(value(together_contrast(2, 1)).value, 0.0);
  EXPECT_EQ(value(together_contrast(2, 2)).value, 0.0);
  EXPECT_NEAR(value(together_contrast(2, 3)).value, gap, kAlgebra);
  EXPECT_LT(value(together_contrast(2, 3)).interval.high, 0.0);
  EXPECT_NEAR(value(shapley_contrast(2, 0)).value, gap / 2.0, kAlgebra);
  EXPECT_NEAR(value(main_contrast(2, 1)).value, gap / 2.0, kAlgebra);
  EXPECT_NEAR(value(last_contrast(2, 1)).value, gap, kAlgebra);
  EXPECT_NEAR(contrast_share(outcomes, shapley_contrast(2, 1), gap_contrast(2), options, bootstrap).value, 0.5,
              kAlgebra);
  EXPECT_EQ(sufficient_set(outcomes, 0.05), 3U);
}

TEST(Factorial, AnEffectThatNoEpisodeShowsIsNotKnownToBeNone) {
  const FactorialOutcomes outcomes = drawn({1.0, 1.0}, 30, 1);
  ClusterBootstrap bootstrap(500, 1);
  const ContrastValue gap = contrast_value(outcomes, gap_contrast(1), {.resamples = 500}, bootstrap);
  EXPECT_EQ(gap.value, 0.0);
  EXPECT_LT(gap.interval.low, -0.05);
  EXPECT_GT(gap.interval.high, 0.05);
  EXPECT_TRUE(
      std::isnan(contrast_share(outcomes, gap_contrast(1), gap_contrast(1), {.resamples = 500}, bootstrap).value));
  EXPECT_EQ(sufficient_set(outcomes, 0.05), 0U);
}

TEST(Factorial, TheIntervalHoldsTheTruth) {
  const std::vector<double> chances = {0.9, 0.8, 0.85, 0.3};
  const Contrast contrast = together_contrast(2, 3);
  double truth = 0.0;
  for (std::size_t cell = 0; cell < 4; ++cell) truth += contrast[cell] * chances[cell];
  int held = 0;
  constexpr int kRuns = 100;
  for (int run = 0; run < kRuns; ++run) {
    ClusterBootstrap bootstrap(400, 1);
    const Interval interval =
        contrast_value(drawn(chances, 60, static_cast<std::uint64_t>(run)), contrast, {.resamples = 400}, bootstrap)
            .interval;
    held += interval.low <= truth && truth <= interval.high ? 1 : 0;
  }
  EXPECT_GE(held, 90);  // of a level of 95 %: fewer has a chance below 1 in 50
}

TEST(Factorial, TheSmallestSetThatMakesTheGapIsFound) {
  // The second switch makes all of it; the third nothing.
  EXPECT_EQ(sufficient_set(drawn({0.9, 0.9, 0.3, 0.3, 0.9, 0.9, 0.3, 0.3}, 200, 3), 0.05), 2U);
  // The first makes half, the second the other.
  EXPECT_EQ(sufficient_set(drawn({0.9, 0.6, 0.6, 0.3, 0.9, 0.6, 0.6, 0.3}, 200, 3), 0.05), 3U);
}

TEST(Factorial, NamesItsSets) {
  const std::vector<std::string> names = {"law", "armature", "dt"};
  EXPECT_EQ(set_name(names, 5), "law x dt");
  EXPECT_EQ(set_name(names, 2, "+"), "armature");
}

TEST(Factorial, RefusesSizesThatDoNotFit) {
  ClusterBootstrap bootstrap(10, 1);
  const FactorialOutcomes outcomes = drawn({1.0, 0.5}, 3, 1);
  EXPECT_THAT(test::thrown_message<std::invalid_argument>([&] { return gap_contrast(5); }),
              testing::HasSubstr("expected 1 to 4 switches"));
  EXPECT_THAT(test::thrown_message<std::invalid_argument>([&] { return together_contrast(2, 0); }),
              testing::HasSubstr("expected a set"));
  EXPECT_THAT(test::thrown_message<std::invalid_argument>(
                  [&] { return contrast_value(outcomes, gap_contrast(2), {}, bootstrap); }),
              testing::HasSubstr("expected 2 cells of 1 switches"));
  EXPECT_THAT(test::thrown_message<std::invalid_argument>([&] {
                return contrast_value({.switches = 1, .cells = {{}, {}}, .clips = {}}, gap_contrast(1), {}, bootstrap);
              }),
              testing::HasSubstr("expected at least one episode"));
}

}  // namespace
}  // namespace duet
