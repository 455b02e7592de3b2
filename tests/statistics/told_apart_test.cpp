#include "duet/statistics/told_apart.h"

#include <cmath>
#include <limits>

#include "duet/core/numbers.h"
#include "tests/support.h"

namespace duet {
namespace {

// Clusters of samples with three features, of which the first is moved and the second spread in the first group.
std::vector<GroupedSample> samples_of(int clusters, double moved, double spread, std::uint64_t seed = 1) {
  std::vector<GroupedSample> samples;
  for (int cluster = 0; cluster < clusters; ++cluster) {
    Random random(seed, static_cast<std::uint64_t>(cluster));
    const bool first = cluster % 2 == 0;
    for (int i = 0; i < 3; ++i) {
      const double x = random.normal(), y = random.normal(), z = random.normal();
      samples.push_back({{x + (first ? moved : 0.0), first ? spread * y : y, z}, first, cluster});
    }
  }
  return samples;
}

TEST(ToldApart, AreaIsTheShareOfPairsInOrder) {
  const std::vector<double> scores = {0.1, 0.4, 0.35, 0.8};
  EXPECT_DOUBLE_EQ(area_under_curve(scores, {false, false, true, true}), 0.75);
  EXPECT_DOUBLE_EQ(area_under_curve(scores, {true, true, false, false}), 0.25);
  EXPECT_DOUBLE_EQ(area_under_curve(std::vector<double>{1.0, 1.0, 1.0}, {true, false, true}), 0.5);
  EXPECT_TRUE(std::isnan(area_under_curve(scores, {true, true, true, true})));
}

TEST(ToldApart, GroupsThatAreAlikeAreNotTold) {
  const ToldApart told = told_apart(samples_of(200, 0.0, 1.0), 1);
  EXPECT_NEAR(told.area, 0.5, 0.08);
  EXPECT_LT(told.interval.low, 0.5);
  EXPECT_GT(told.interval.high, 0.5);
  EXPECT_EQ(told.first_clusters, 100);
  EXPECT_EQ(told.clusters, 200);
}

// A difference of d deviations has the area Phi(d / sqrt(2)).
TEST(ToldApart, AShiftIsToldAsWellAsItCanBe) {
  const ToldApart told = told_apart(samples_of(200, 2.0, 1.0), 1);
  EXPECT_NEAR(told.area, 0.5 * std::erfc(-1.0), 0.04);
  EXPECT_EQ(told.weights.front().feature, 0);
  EXPECT_GT(told.weights.front().linear, std::abs(told.weights.front().square));
}

TEST(ToldApart, AWiderSpreadIsToldByTheSquare) {
  const ToldApart told = told_apart(samples_of(200, 0.0, 3.0), 1);
  EXPECT_GT(told.area, 0.7);
  EXPECT_EQ(told.weights.front().feature, 1);
  EXPECT_GT(told.weights.front().square, std::abs(told.weights.front().linear));
}

// Windows of a clip resemble each other: with a mark of its own on each clip, a division by window would tell by it.
TEST(ToldApart, SamplesOfAClipStayOnOneSide) {
  std::vector<GroupedSample> samples;
  for (int cluster = 0; cluster < 40; ++cluster) {
    Random random(5, static_cast<std::uint64_t>(cluster));
    const double mark = random.normal(), other = random.normal();
    for (int i = 0; i < 20; ++i) samples.push_back({{mark, other}, random.chance(0.0) || cluster % 2 == 0, cluster});
  }
  EXPECT_NEAR(told_apart(samples, 1).area, 0.5, 0.25);
}

TEST(ToldApart, SeedDecidesAndMissingFeaturesAreTaken) {
  std::vector<GroupedSample> samples = samples_of(60, 1.0, 1.0);
  samples[4].features[2] = std::numeric_limits<double>::quiet_NaN();
  EXPECT_EQ(told_apart(samples, 3).area, told_apart(samples, 3).area);
  EXPECT_TRUE(std::isfinite(told_apart(samples, 3).area));
}

TEST(ToldApart, TooFewOrUnequalSamplesAreRefused) {
  const auto message = [](const std::vector<GroupedSample>& samples) {
    return test::thrown_message<std::invalid_argument>([&] { (void)told_apart(samples, 1); });
  };
  EXPECT_SENTENCE(message(samples_of(14, 0.0, 1.0)));
  std::vector<GroupedSample> unequal = samples_of(40, 0.0, 1.0);
  unequal[7].features.pop_back();
  EXPECT_SENTENCE(message(unequal));
}

}  // namespace
}  // namespace duet
