#include "duet/statistics/statistics.h"

#include <array>
#include <cmath>
#include <numeric>
#include <vector>

#include "duet/core/numbers.h"
#include "tests/support.h"

namespace duet {
namespace {

using test::thrown_message;

double normal_cdf(double x) { return 0.5 * std::erfc(-x / std::sqrt(2.0)); }

// Percent with one decimal, as tables print it.
double tenths(double fraction) { return std::round(1000.0 * fraction) / 10.0; }

TEST(NormalQuantile, InvertsTheDistributionFunction) {
  for (const double p :
       {1e-300, 1e-100, 1e-20, 1e-9, 1e-6, 1e-3, 0.025, 0.074, 0.076, 0.2, 0.5, 0.6, 0.8, 0.9249, 0.9251}) {
    EXPECT_NEAR(normal_cdf(normal_quantile(p)) / p, 1.0, 1e-11) << p;  // relative slope of the tail is up to x^2
  }
}

TEST(NormalQuantile, MatchesPublishedValues) {
  EXPECT_NEAR(normal_quantile(0.975), 1.959963984540054, 1e-14);
  EXPECT_NEAR(normal_quantile(0.8), 0.8416212335729143, 1e-14);
  EXPECT_NEAR(normal_quantile(0.25), -0.6744897501960817, 1e-14);  // Wichura's own check values
  EXPECT_NEAR(normal_quantile(0.001), -3.090232306167814, 1e-13);
  EXPECT_NEAR(normal_quantile(1e-20), -9.262340089798408, 1e-12);
}

TEST(NormalQuantile, IsOddAboutTheMedian) {
  EXPECT_EQ(normal_quantile(0.5), 0.0);
  for (const double p : {0.03125, 0.25, 0.4375}) EXPECT_EQ(normal_quantile(p), -normal_quantile(1.0 - p));
}

TEST(NormalQuantile, RefusesTheEnds) {
  for (const double p : {0.0, 1.0, -0.1, std::nan("")}) {
    EXPECT_SENTENCE(thrown_message<std::invalid_argument>([&] { normal_quantile(p); }));
  }
}

TEST(Wilson, MatchesPublishedIntervals) {
  const std::array<std::array<double, 4>, 5> published = {{{107, 126, 77.6, 90.1},  // Table S9 read as n = 126
                                                           {98, 126, 69.8, 84.2},
                                                           {95, 126, 67.2, 82.1},
                                                           {81, 263, 25.5, 36.6},   // Newcombe 1998, Table I
                                                           {15, 148, 6.2, 16.0}}};  // likewise
  for (const auto& [k, n, low, high] : published) {
    const Interval interval = wilson(static_cast<long>(k), static_cast<long>(n));
    EXPECT_EQ(tenths(interval.low), low) << k << "/" << n;
    EXPECT_EQ(tenths(interval.high), high) << k << "/" << n;
  }
}

// The Wilson limits are the p at which the score test just rejects.
TEST(Wilson, LimitsSolveTheScoreEquation) {
  const double z = normal_quantile(0.975);
  for (const long n : {1L, 5L, 30L, 1000L}) {
    for (long k = 1; k < n; k += 1 + n / 7) {
      const Interval interval = wilson(k, n);
      const double rate = static_cast<double>(k) / static_cast<double>(n);
      for (const double p : {interval.low, interval.high}) {
        EXPECT_NEAR(std::abs(rate - p) / std::sqrt(p * (1.0 - p) / static_cast<double>(n)), z, 1e-9) << k << "/" << n;
      }
    }
  }
}

TEST(Wilson, EndsAndEmpty) {
  EXPECT_EQ(wilson(0, 0).low, 0.0);
  EXPECT_EQ(wilson(0, 0).high, 1.0);
  EXPECT_EQ(wilson(0, 20).low, 0.0);
  EXPECT_EQ(wilson(20, 20).high, 1.0);
  EXPECT_NEAR(wilson(0, 29).high, 0.1170, 5e-5);  // Newcombe 1998, Table I
  for (long k = 0; k <= 17; ++k) {
    EXPECT_NEAR(wilson(k, 17).low, 1.0 - wilson(17 - k, 17).high, 1e-15);
  }
}

TEST(Wilson, RefusesWhatIsNoCount) {
  EXPECT_SENTENCE(thrown_message<std::invalid_argument>([] { wilson(3, 2); }));
  EXPECT_SENTENCE(thrown_message<std::invalid_argument>([] { wilson(-1, 2); }));
  EXPECT_SENTENCE(thrown_message<std::invalid_argument>([] { wilson(1, 2, 1.0); }));
}

TEST(Wilson, CoversAtAboutItsLevel) {
  Random random(7, stream_key({"wilson coverage"}));
  for (const double p : {0.5, 0.85, 0.95}) {
    int covered = 0;
    constexpr int kTrials = 4000;
    for (int trial = 0; trial < kTrials; ++trial) {
      long k = 0;
      for (int i = 0; i < 126; ++i) k += random.chance(p) ? 1 : 0;
      const Interval interval = wilson(k, 126);
      covered += interval.low <= p && p <= interval.high ? 1 : 0;
    }
    // The exact coverage at n = 126 lies in [0.93, 0.97] for these p; 4000 trials add at most 0.015 (4 sigma).
    EXPECT_NEAR(static_cast<double>(covered) / kTrials, 0.95, 0.035) << p;
  }
}

TEST(NewcombePaired, MatchesPublishedIntervals) {
  const Interval consolidation =
      newcombe_paired(59, 6, 16, 80);  // Fagerland, Lydersen, Laake 2017, chapter 8 (Cavo 2012)
  EXPECT_NEAR(consolidation.low, -0.1186, 5e-5);
  EXPECT_NEAR(consolidation.high, -0.0046, 5e-5);
  const Interval airway = newcombe_paired(1, 1, 7, 12);  // likewise (Bentur 2009)
  EXPECT_NEAR(airway.low, -0.507, 5e-4);
  EXPECT_NEAR(airway.high, -0.026, 5e-4);
  const Interval worked = newcombe_paired(14, 5, 0, 22);  // Altman et al., Statistics with Confidence, 2nd ed., p. 52
  EXPECT_NEAR(worked.low, 0.011, 5e-4);
  EXPECT_NEAR(worked.high, 0.226, 5e-4);
}

TEST(NewcombePaired, SwappingTheArmsMirrorsTheInterval) {
  for (const auto& [a, b, c, d] :
       std::vector<std::array<long, 4>>{{80, 20, 5, 21}, {0, 3, 9, 0}, {12, 0, 0, 3}, {1, 0, 0, 0}}) {
    const Interval forward = newcombe_paired(a, b, c, d);
    const Interval backward = newcombe_paired(a, c, b, d);
    EXPECT_NEAR(forward.low, -backward.high, 1e-15);
    EXPECT_NEAR(forward.high, -backward.low, 1e-15);
    EXPECT_LE(forward.low, static_cast<double>(b - c) / static_cast<double>(a + b + c + d));
    EXPECT_GE(forward.low, -1.0 - 1e-15);
    EXPECT_LE(forward.high, 1.0 + 1e-15);
  }
}

TEST(NewcombePaired, WithoutPairsSaysNothing) {
  EXPECT_EQ(newcombe_paired(0, 0, 0, 0).low, -1.0);
  EXPECT_EQ(newcombe_paired(0, 0, 0, 0).high, 1.0);
  EXPECT_SENTENCE(thrown_message<std::invalid_argument>([] { newcombe_paired(1, -2, 0, 0); }));
}

// Fisher's tea: 3 of 4 against 1 of 4, and every split of small tables adds up to one.
TEST(Fisher, CountsTheTablesThatAreAtLeastAsFar) {
  EXPECT_NEAR(fisher_exact_greater(3, 4, 1, 4), 17.0 / 70.0, 1e-13);
  EXPECT_NEAR(fisher_exact_greater(4, 4, 0, 4), 1.0 / 70.0, 1e-13);
  EXPECT_NEAR(fisher_exact_greater(0, 5, 3, 7), 1.0, 1e-13);
  EXPECT_NEAR(fisher_exact_greater(5, 5, 3, 3), 1.0, 1e-13);
  EXPECT_EQ(fisher_exact_greater(0, 0, 2, 3), 1.0);
  for (long k = 1; k <= 4; ++k)  // more in one group is as likely as fewer in the other
    EXPECT_NEAR(fisher_exact_greater(k, 5, 4 - k, 6) + fisher_exact_greater(5 - k, 6, k - 1, 5), 1.0, 1e-12) << k;
  EXPECT_THROW(fisher_exact_greater(3, 2, 0, 4), std::invalid_argument);
}

// Twice the smaller tail over all 2^n ways in which the discordant pairs could have fallen.
double enumerated_mcnemar(long only_a, long only_b) {
  const long n = only_a + only_b;
  long as_extreme = 0;
  for (long ways = 0; ways < (1L << n); ++ways) {
    if (__builtin_popcountl(static_cast<unsigned long>(ways)) <= std::min(only_a, only_b)) ++as_extreme;
  }
  return std::min(1.0, 2.0 * static_cast<double>(as_extreme) / static_cast<double>(1L << n));
}

// Newcombe 1998 (Statistics in Medicine 17, 873), table II, example (a), method 10: 56/70 against 48/80.
TEST(Newcombe, OfTwoIndependentSharesIsThatOfThePaper) {
  const Interval interval = newcombe_of_shares(0.8, wilson(56, 70), 0.6, wilson(48, 80));
  EXPECT_NEAR(interval.low, 0.0524, 5e-5);
  EXPECT_NEAR(interval.high, 0.3339, 5e-5);
}

TEST(McNemar, EqualsEnumeration) {
  for (long a = 0; a <= 8; ++a) {
    for (long b = 0; b <= 8; ++b) EXPECT_NEAR(mcnemar_exact(a, b), enumerated_mcnemar(a, b), 1e-13) << a << " " << b;
  }
}

TEST(McNemar, MatchesPublishedValuesAndLaws) {
  EXPECT_NEAR(mcnemar_exact(1, 7), 0.0703, 5e-5);   // Fagerland, Lydersen, Laake 2013 (Bentur 2009)
  EXPECT_NEAR(mcnemar_exact(6, 16), 0.0525, 5e-5);  // likewise (Cavo 2012)
  EXPECT_EQ(mcnemar_exact(0, 0), 1.0);
  EXPECT_EQ(mcnemar_exact(30, 11), mcnemar_exact(11, 30));
  // Far past where 2^-n underflows: the normal approximation with continuity correction agrees.
  EXPECT_NEAR(mcnemar_exact(5100, 4900), std::erfc(199.0 / 100.0 / std::sqrt(2.0)), 1e-4);
  EXPECT_SENTENCE(thrown_message<std::invalid_argument>([] { mcnemar_exact(-1, 0); }));
}

TEST(ClusterBootstrap, SharedDrawsChangeNothing) {
  const std::vector<double> values = {0.1, 0.7, 0.2, 0.9, 0.4, 0.3};
  const std::vector<int> three = {0, 0, 1, 1, 2, 2};
  const std::vector<int> two = {0, 1, 0, 1, 0, 1};
  ClusterBootstrap shared(500, 3);
  for (const std::vector<int>& cluster : {three, two, three}) {
    const Interval expected = cluster_bootstrap(values, cluster, 500, 3);
    const Interval found = shared.mean(values, cluster);
    EXPECT_EQ(found.low, expected.low);
    EXPECT_EQ(found.high, expected.high);
  }
}

TEST(ClusterBootstrap, DependsOnTheSeedOnlyAndNotOnClusterNames) {
  const std::vector<double> values = {0, 1, 1, 0, 1, 1, 0, 1, 0.5, 2};
  const std::vector<int> cluster = {0, 0, 1, 1, 2, 2, 3, 3, 4, 4};
  const std::vector<int> renamed = {9, 9, 1, 1, -7, -7, 30, 30, 4, 4};
  const Interval once = cluster_bootstrap(values, cluster, 500, 3);
  const Interval again = cluster_bootstrap(values, renamed, 500, 3);
  EXPECT_EQ(once.low, again.low);
  EXPECT_EQ(once.high, again.high);
  EXPECT_LT(once.low, 0.75);
  EXPECT_GT(once.high, 0.75);
}

TEST(ClusterBootstrap, OneClusterHasNoSpread) {
  const Interval interval = cluster_bootstrap(std::vector<double>{1, 2, 6}, std::vector<int>{5, 5, 5}, 100, 1);
  EXPECT_EQ(interval.low, 3.0);
  EXPECT_EQ(interval.high, 3.0);
}

TEST(ClusterBootstrap, MatchesTheExactResamplingDistribution) {
  // Two clusters with means 0 and 1: the mean of a resample is 0, 1/2, 1 with probabilities 1/4, 1/2, 1/4.
  const Interval wide = cluster_bootstrap(std::vector<double>{0, 1}, std::vector<int>{0, 1}, 4000, 1, 0.6);
  EXPECT_EQ(wide.low, 0.0);
  EXPECT_EQ(wide.high, 1.0);
  const Interval narrow = cluster_bootstrap(std::vector<double>{0, 1}, std::vector<int>{0, 1}, 4000, 1, 0.4);
  EXPECT_EQ(narrow.low, 0.5);
  EXPECT_EQ(narrow.high, 0.5);
}

// Values that agree within a cluster: clustered intervals keep their level, those that ignore it do not.
TEST(ClusterBootstrap, CoversWhereValuesWithinAClusterAgree) {
  constexpr int kTrials = 200;
  Random random(11, stream_key({"bootstrap coverage"}));
  int clustered = 0;
  int naive = 0;
  for (int trial = 0; trial < kTrials; ++trial) {
    std::vector<double> values;
    std::vector<int> ids;
    for (int c = 0; c < 40; ++c) {
      const double shared = random.normal();
      for (int i = 0; i < 5; ++i) {
        values.push_back(shared + 0.2 * random.normal());
        ids.push_back(c);
      }
    }
    std::vector<int> each(values.size());
    std::iota(each.begin(), each.end(), 0);
    const Interval by_cluster = cluster_bootstrap(values, ids, 400, trial);
    const Interval by_value = cluster_bootstrap(values, each, 400, trial);
    clustered += by_cluster.low <= 0.0 && 0.0 <= by_cluster.high ? 1 : 0;
    naive += by_value.low <= 0.0 && 0.0 <= by_value.high ? 1 : 0;
  }
  // Binomial spread of 200 trials at 0.95 is 0.015; a percentile interval over 40 clusters loses one or two points.
  EXPECT_NEAR(static_cast<double>(clustered) / kTrials, 0.94, 0.05);
  EXPECT_LT(static_cast<double>(naive) / kTrials, 0.75);
}

TEST(ClusterBootstrap, RefusesWrongShapes) {
  const auto message = [](std::vector<double> values, std::vector<int> ids, int resamples) {
    return thrown_message<std::invalid_argument>([&] { cluster_bootstrap(values, ids, resamples, 1); });
  };
  EXPECT_SENTENCE(message({}, {}, 10));
  EXPECT_SENTENCE(message({1, 2}, {0}, 10));
  EXPECT_SENTENCE(message({1}, {0}, 0));
}

TEST(Holm, TextbookExample) {
  // Four tests at 0.05 (Holm's procedure as taught): only the two smallest are rejected.
  const std::vector<double> adjusted = holm(std::vector<double>{0.01, 0.04, 0.03, 0.005});
  const std::vector<double> expected = {0.03, 0.06, 0.06, 0.02};
  ASSERT_EQ(adjusted.size(), expected.size());
  for (std::size_t i = 0; i < expected.size(); ++i) EXPECT_NEAR(adjusted[i], expected[i], 1e-15);
}

TEST(Holm, Laws) {
  EXPECT_TRUE(holm({}).empty());
  EXPECT_EQ(holm(std::vector<double>{0.2}), std::vector<double>{0.2});
  EXPECT_EQ(holm(std::vector<double>{0.9, 0.8}), (std::vector<double>{1.0, 1.0}));
  EXPECT_EQ(holm(std::vector<double>{0.1, 0.1, 0.1}), (std::vector<double>(3, 3 * 0.1)));
  EXPECT_SENTENCE(thrown_message<std::invalid_argument>([] { holm(std::vector<double>{0.1, 1.5}); }));
  EXPECT_SENTENCE(thrown_message<std::invalid_argument>([] { holm(std::vector<double>{std::nan("")}); }));
}

TEST(MinimumDetectableDifference, MatchesTheReferenceFigures) {
  EXPECT_NEAR(minimum_detectable_difference(0.85, 126), 0.126, 5e-4);  // "about 12.6 points at n = 126"
  EXPECT_NEAR(minimum_detectable_difference(0.85, 800), 0.05, 5e-5);   // "5 points need about 800 per arm"
}

TEST(MinimumDetectableDifference, FallsWithNAndStaysUsableAtTheEnds) {
  EXPECT_GT(minimum_detectable_difference(0.5, 50), minimum_detectable_difference(0.5, 100));
  EXPECT_NEAR(minimum_detectable_difference(0.0, 126), minimum_detectable_difference(1.0, 126), 1e-15);
  EXPECT_GT(minimum_detectable_difference(1.0, 126), 0.03);
  EXPECT_EQ(minimum_detectable_difference(0.5, 1), 1.0);
  EXPECT_SENTENCE(thrown_message<std::invalid_argument>([] { minimum_detectable_difference(0.5, 0); }));
  EXPECT_SENTENCE(thrown_message<std::invalid_argument>([] { minimum_detectable_difference(1.5, 9); }));
  EXPECT_SENTENCE(thrown_message<std::invalid_argument>([] { minimum_detectable_difference(0.5, 9, 0.0); }));
  EXPECT_SENTENCE(thrown_message<std::invalid_argument>([] { minimum_detectable_difference(0.5, 9, 0.05, 1.0); }));
}

TEST(MinimumDetectableDifferencePaired, SolvesConnorsEquation) {
  const double za = normal_quantile(0.975);
  const double zb = normal_quantile(0.8);
  for (const double discordance : {0.15, 0.3, 0.8, 1.0}) {
    for (const long n : {60L, 126L, 1000L}) {
      const double d = minimum_detectable_difference_paired(discordance, n);
      EXPECT_LT(d, discordance);
      EXPECT_NEAR(d * std::sqrt(n), za * std::sqrt(discordance) + zb * std::sqrt(discordance - d * d), 1e-9);
    }
  }
}

TEST(MinimumDetectableDifferencePaired, WithoutDiscordanceIsTheOneSidedLimit) {
  const double za = normal_quantile(0.975);
  const double zb = normal_quantile(0.8);
  const double d = minimum_detectable_difference_paired(0.0, 126);
  EXPECT_NEAR(std::sqrt(126 * d), za + zb * std::sqrt(1.0 - d), 1e-9);
  EXPECT_NEAR(d, 0.061, 1e-3);
  EXPECT_EQ(minimum_detectable_difference_paired(0.5, 3), 1.0);
  EXPECT_SENTENCE(thrown_message<std::invalid_argument>([] { minimum_detectable_difference_paired(-0.1, 9); }));
}

// A difference of the size that was promised is found in about 80 % of simulated runs.
TEST(MinimumDetectableDifferencePaired, HasThePowerItPromises) {
  constexpr long kPairs = 200;
  constexpr double kDiscordance = 0.3;
  const double d = minimum_detectable_difference_paired(kDiscordance, kPairs);
  const double only_a_rate = 0.5 * (kDiscordance + d);
  Random random(5, stream_key({"power"}));
  int found = 0;
  constexpr int kTrials = 2000;
  for (int trial = 0; trial < kTrials; ++trial) {
    long only_a = 0;
    long only_b = 0;
    for (long i = 0; i < kPairs; ++i) {
      const double draw = random.uniform();
      only_a += draw < only_a_rate ? 1 : 0;
      only_b += draw >= only_a_rate && draw < kDiscordance ? 1 : 0;
    }
    found += mcnemar_exact(only_a, only_b) < 0.05 ? 1 : 0;
  }
  // The exact test is conservative: it gives up some points of power against the normal formula.
  EXPECT_GT(static_cast<double>(found) / kTrials, 0.72);
  EXPECT_LT(static_cast<double>(found) / kTrials, 0.84);
}

TEST(ClusterBootstrap, RatioOfEqualRatiosHasNoWidth) {
  const std::vector<double> above = {1.0, 2.0, 6.0};
  const std::vector<double> below = {2.0, 4.0, 12.0};
  const std::vector<int> clusters = {0, 1, 2};
  const Interval interval = ClusterBootstrap(200, 1).ratio(above, below, clusters);
  EXPECT_DOUBLE_EQ(interval.low, 0.5);
  EXPECT_DOUBLE_EQ(interval.high, 0.5);
}

TEST(ClusterBootstrap, RatioRefusesDivisorsThatAreNotAboveZero) {
  const std::vector<double> above = {1.0, 2.0};
  const std::vector<int> clusters = {0, 1};
  const auto message = [&](const std::vector<double>& below) {
    return thrown_message<std::invalid_argument>([&] { ClusterBootstrap(10, 1).ratio(above, below, clusters); });
  };
  EXPECT_SENTENCE(message({1.0, 0.0}));
  EXPECT_SENTENCE(message({1.0}));
}

TEST(ClusterBootstrap, WeightedMedianIsDrawnByCluster) {
  // Two clusters with one value each are drawn as both of the first, one of each or both of the second, 1 : 2 : 1.
  const Interval interval =
      ClusterBootstrap(4000, 1).weighted_median(std::vector{1.0, 3.0}, std::vector{1.0, 1.0}, std::vector{0, 1}, 0.4);
  EXPECT_EQ(interval.low, 2.0);
  EXPECT_EQ(interval.high, 2.0);
  const Interval wide =
      ClusterBootstrap(4000, 1).weighted_median(std::vector{1.0, 3.0}, std::vector{1.0, 1.0}, std::vector{0, 1}, 0.6);
  EXPECT_EQ(wide.low, 1.0);
  EXPECT_EQ(wide.high, 3.0);
}

TEST(ClusterBootstrap, AnOutlierMovesTheRatioAndNotTheWeightedMedian) {
  const std::vector<double> robot = {1.0, 1.0, 1.0, -8.0, 1.0}, partner(5, 1.0);
  const std::vector<int> clusters = {0, 1, 2, 3, 4};
  ClusterBootstrap bootstrap(500, 1);
  EXPECT_LT(bootstrap.ratio(robot, partner, clusters, 0.8).low, 0.0);
  EXPECT_EQ(bootstrap.weighted_median(robot, partner, clusters, 0.8).low, 1.0);
}

// Sorted once for all draws, it is the median that sorts for each of them.
TEST(ClusterBootstrap, WeightedMedianIsThatOfEachDraw) {
  Random random(7, 0);
  std::vector<double> values, weights;
  std::vector<int> clusters;
  for (int i = 0; i < 60; ++i) {
    values.push_back(0.25 * random.below(20));  // with ties
    weights.push_back(0.125 * (1 + random.below(9)));
    clusters.push_back(i / 4);
  }
  ClusterBootstrap bootstrap(500, 3);
  const Interval found = bootstrap.weighted_median(values, weights, clusters);
  const Interval of_each = bootstrap.weighted(clusters, [&](std::span<const double> times) {
    std::vector<double> drawn(weights.size());
    for (std::size_t i = 0; i < drawn.size(); ++i) drawn[i] = times[i] * weights[i];
    return weighted_median(values, drawn);
  });
  EXPECT_EQ(found.low, of_each.low);
  EXPECT_EQ(found.high, of_each.high);
}

TEST(ClusterBootstrap, WeightedMedianRefusesWeightsThatAreNotAboveZero) {
  EXPECT_SENTENCE(thrown_message<std::invalid_argument>(
      [] { ClusterBootstrap(10, 1).weighted_median(std::vector{1.0}, std::vector{0.0}, std::vector{0}); }));
}

}  // namespace
}  // namespace duet
