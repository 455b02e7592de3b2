
#include <array>
#include <cmath>
#include <limits>
#include <span>

#include "duet/core/numbers.h"
#include "tests/support.h"

namespace duet {
namespace {

using test::thrown_message;

TEST(Quantile, IsLinearBetweenOrderStatistics) {
  EXPECT_DOUBLE_EQ(quantile({4.0, 1.0, 3.0, 2.0}, 0.25), 1.75);
  EXPECT_DOUBLE_EQ(quantile({4.0, 1.0, 3.0, 2.0}, 0.5), 2.5);
  EXPECT_DOUBLE_EQ(quantile({4.0, 1.0, 3.0, 2.0}, 1.0), 4.0);
  EXPECT_DOUBLE_EQ(quantile({7.0}, 0.3), 7.0);
  EXPECT_TRUE(std::isnan(quantile({}, 0.5)));
  EXPECT_SENTENCE(thrown_message<std::invalid_argument>([] { quantile({1.0}, 1.5); }));
}

TEST(Quantile, OfSortedValuesReadsNothingBehindThem) {
  const double kNothing = std::numeric_limits<double>::quiet_NaN();
  const std::array values = {1.0, 2.0, 4.0, kNothing};
  const std::span<const double> sorted = std::span(values).first(3);
  EXPECT_DOUBLE_EQ(quantile_of_sorted(sorted, 0.0), 1.0);
  EXPECT_DOUBLE_EQ(quantile_of_sorted(sorted, 0.75), 3.0);
  EXPECT_DOUBLE_EQ(quantile_of_sorted(sorted, 1.0), 4.0);
  EXPECT_TRUE(std::isnan(quantile_of_sorted({}, 0.5)));
}

TEST(Kendall, CountsPairsAndCorrectsForTies) {
  const RankAgreement same = kendall(std::vector{1.0, 2.0, 3.0, 4.0}, std::vector{0.1, 0.2, 0.3, 0.4});
  EXPECT_EQ(same.pairs, 6);
  EXPECT_EQ(same.concordant, 6);
  EXPECT_DOUBLE_EQ(same.tau_b, 1.0);
  EXPECT_DOUBLE_EQ(kendall(std::vector{1.0, 2.0, 3.0}, std::vector{3.0, 2.0, 1.0}).tau_b, -1.0);
  // Four of six pairs agree, one is tied in a, another in b: 4 / sqrt(5 * 5).
  const RankAgreement tied = kendall(std::vector{1.0, 1.0, 2.0, 3.0}, std::vector{1.0, 2.0, 2.0, 3.0});
  EXPECT_EQ(tied.concordant, 4);
  EXPECT_EQ(tied.discordant, 0);
  EXPECT_DOUBLE_EQ(tied.tau_b, 0.8);
  // The example of scipy.stats.kendalltau, version 1.10.1.
  EXPECT_NEAR(kendall(std::vector{12.0, 2.0, 1.0, 12.0, 2.0}, std::vector{1.0, 4.0, 7.0, 1.0, 0.0}).tau_b,
              -0.47140452079103173, 1e-15);
}

TEST(Kendall, RoundingMakesNoOrder) {
  const RankAgreement agreement = kendall(std::vector{(0.1 + 0.2) / 2.0, 0.3 / 2.0}, std::vector{0.0, 1.0});
  EXPECT_EQ(agreement.concordant + agreement.discordant, 0);
  EXPECT_TRUE(std::isnan(agreement.tau_b));
}

TEST(Kendall, IsNotDefinedForOneItemOrTiesThroughout) {
  EXPECT_TRUE(std::isnan(kendall({}, {}).tau_b));
  EXPECT_TRUE(std::isnan(kendall(std::vector{1.0}, std::vector{1.0}).tau_b));
  EXPECT_TRUE(std::isnan(kendall(std::vector{1.0, 1.0}, std::vector{1.0, 2.0}).tau_b));
  EXPECT_SENTENCE(thrown_message<std::invalid_argument>([] { kendall(std::vector{1.0}, {}); }));
}

double weighted_median_of(const std::vector<double>& values, const std::vector<double>& weights) {
  return weighted_median(values, weights);
}

TEST(WeightedMedian, HasHalfOfTheWeightOnEitherSide) {
  EXPECT_EQ(weighted_median_of({3.0, 1.0, 2.0}, {1.0, 1.0, 1.0}), 2.0);
  EXPECT_EQ(weighted_median_of({3.0, 1.0, 2.0}, {5.0, 1.0, 1.0}), 3.0);
  EXPECT_EQ(weighted_median_of({1.0, 4.0}, {1.0, 1.0}), 2.5);
  EXPECT_EQ(weighted_median_of({4.0, 1.0, 9.0, 2.0}, {1.0, 2.0, 0.0, 1.0}), 1.5);  // nobody has the weight of 9
  EXPECT_TRUE(std::isnan(weighted_median_of({}, {})));
  EXPECT_TRUE(std::isnan(weighted_median_of({1.0}, {0.0})));
}

TEST(WeightedMedian, OfRatiosIsTheLineOfLeastAbsoluteDeviations) {
  const std::vector<double> x = {1.0, -0.5, 2.0, 1.5, -1.0}, y = {0.9, -0.6, 0.2, 1.6, -0.7};
  const auto deviations = [&](double slope) {
    double total = 0.0;
    for (std::size_t i = 0; i < x.size(); ++i) total += std::abs(y[i] - slope * x[i]);
    return total;
  };
  std::vector<double> ratios, sizes;
  for (std::size_t i = 0; i < x.size(); ++i) {
    ratios.push_back(y[i] / x[i]);
    sizes.push_back(std::abs(x[i]));
  }
  const double slope = weighted_median(ratios, sizes);
  for (const double other : ratios) EXPECT_LE(deviations(slope), deviations(other)) << other;
}

TEST(WeightedMedian, RefusesWrongWeights) {
  const auto message = [](const std::vector<double>& weights) {
    return thrown_message<std::invalid_argument>([&] { weighted_median_of({1.0, 2.0}, weights); });
  };
  EXPECT_SENTENCE(message({1.0}));
  EXPECT_SENTENCE(message({1.0, -1.0}));
}

// Weeks of remission, Freireich et al. 1963, the example of most textbooks.
std::vector<Lifetime> remission() {
  std::vector<Lifetime> weeks;
  for (const double end : {6, 6, 6, 7, 10, 13, 16, 22, 23}) weeks.push_back({.time = end, .ended = true});
  for (const double last : {6, 9, 10, 11, 17, 19, 20, 25, 32, 32, 34, 35}) weeks.push_back({.time = last});
  return weeks;
}

TEST(KaplanMeier, AgreesWithTheTextbook) {
  // Still in remission: 85.7 % after week 6, 75.3 % after 10, 69.0 % after 13, 53.8 % after 22, 44.8 % after 23.
  EXPECT_EQ(kaplan_meier_quantile(remission(), 0.5), 23.0);
  EXPECT_EQ(kaplan_meier_quantile(remission(), 0.25), 13.0);
  EXPECT_EQ(kaplan_meier_quantile(remission(), 0.14), 6.0);
  EXPECT_TRUE(std::isnan(kaplan_meier_quantile(remission(), 0.75)));
}

TEST(KaplanMeier, WithoutCensoringIsTheOrderStatistic) {
  std::vector<Lifetime> lifetimes;
  for (const double end : {3.0, 1.0, 4.0, 2.0}) lifetimes.push_back({.time = end, .ended = true});
  EXPECT_EQ(kaplan_meier_quantile(lifetimes, 0.25), 1.0);
  EXPECT_EQ(kaplan_meier_quantile(lifetimes, 0.5), 2.0);
  EXPECT_EQ(kaplan_meier_quantile(lifetimes, 0.75), 3.0);
  EXPECT_TRUE(std::isnan(kaplan_meier_quantile({}, 0.5)));
  EXPECT_TRUE(std::isnan(kaplan_meier_quantile({{.time = 1.0}}, 0.5)));
  EXPECT_SENTENCE(thrown_message<std::invalid_argument>([] { kaplan_meier_quantile({}, 0.0); }));
}

}  // namespace
}  // namespace duet
