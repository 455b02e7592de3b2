#include <cmath>
#include <limits>

#include "duet/core/numbers.h"
#include "duet/statistics/clustered.h"
#include "duet/statistics/told_apart.h"
#include "tests/support.h"

namespace duet {
namespace {

constexpr double kAlgebra = 1e-12;

// Every way to turn the sums around.
double enumerated(const std::vector<long>& sums) {
  long total = 0;
  for (const long sum : sums) total += sum;
  long as_large = 0;
  const long ways = 1L << sums.size();
  for (long way = 0; way < ways; ++way) {
    long turned = 0;
    for (std::size_t i = 0; i < sums.size(); ++i) turned += (way >> i & 1) != 0 ? sums[i] : -sums[i];
    as_large += std::abs(turned) >= std::abs(total) ? 1 : 0;
  }
  return static_cast<double>(as_large) / static_cast<double>(ways);
}

TEST(SignFlip, IsTheShareOfAllTurnsThatGiveSoMuch) {
  Random random(11, 1);
  for (int trial = 0; trial < 200; ++trial) {
    std::vector<long> sums(static_cast<std::size_t>(1 + random.below(10)));
    for (long& sum : sums) sum = random.below(9) - 4;
    EXPECT_NEAR(sign_flip_exact(sums), enumerated(sums), kAlgebra) << testing::PrintToString(sums);
  }
}

TEST(SignFlip, IsMcNemarWhereEveryClipHasOnePair) {
  for (const auto& [a, b] : {std::pair(8, 1), {11, 1}, {3, 0}, {0, 0}, {400, 460}}) {
    std::vector<long> sums(static_cast<std::size_t>(a), 1);
    sums.insert(sums.end(), static_cast<std::size_t>(b), -1);
    sums.insert(sums.end(), 5, 0);
    EXPECT_EQ(sign_flip_exact(sums), mcnemar_exact(a, b));
  }
  EXPECT_EQ(sign_flip_exact({}), 1.0);
}

TEST(SignFlip, OfManyClipsIsTheNormalTail) {
  std::vector<long> sums;
  for (int i = 0; i < 4000; ++i) sums.push_back((i % 3 + 1) * (i % 2 == 0 ? 1 : -1));
  for (int i = 0; i < 100; ++i) sums.push_back(2);
  double squares = 0.0;
  long total = 0;
  for (const long sum : sums) {
    squares += static_cast<double>(sum * sum);
    total += sum;
  }
  // Continuity: sums come in steps of 1 about the total, whichever parity they have.
  const double z = (static_cast<double>(total) - 0.5) / std::sqrt(squares);
  EXPECT_NEAR(sign_flip_exact(sums), std::erfc(z / std::sqrt(2.0)), 2e-3);
}

TEST(ByClip, AShareIsNoSurerThanItsClipsAreMany) {
  const std::vector<double> all(8, 1.0);
  const std::vector<int> clips = {0, 1, 2, 3, 4, 5, 6, 7}, two = {0, 0, 0, 0, 1, 1, 1, 1};
  EXPECT_NEAR(wilson_by_clip(all, clips).low, wilson(8, 8).low, kAlgebra);
  EXPECT_NEAR(wilson_by_clip(all, two).low, wilson(2, 2).low, kAlgebra);
  EXPECT_EQ(wilson_by_clip(all, two).high, 1.0);
  const std::vector<double> fifths(30, 0.8);  // four of five engines on every clip
  std::vector<int> thirty(30);
  for (int i = 0; i < 30; ++i) thirty[static_cast<std::size_t>(i)] = i;
  EXPECT_NEAR(wilson_by_clip(fifths, thirty).low, wilson(24, 30).low, kAlgebra);
}

TEST(ByClip, NoIntervalIsNarrowerThanWilsonsOverTheClips) {
  Random random(12, 1);
  for (int trial = 0; trial < 500; ++trial) {
    std::vector<double> values;
    std::vector<int> clips;
    const int count = 1 + random.below(20);
    for (int clip = 0; clip < count; ++clip) {
      const double rate = random.below(5) * 0.25;
      for (int i = random.below(6); i >= 0; --i) {
        values.push_back(random.chance(rate) ? 1.0 : 0.0);
        clips.push_back(clip);
      }
    }
    const Interval found = wilson_by_clip(values, clips);
    const double mean = mean_of(values);
    const Interval least = wilson_of(mean * count, count);
    EXPECT_LE(found.low, least.low + kAlgebra);
    EXPECT_GE(found.high, least.high - kAlgebra);
  }
}

TEST(ByClip, ADifferenceOnOneClipIsOpenToBothSides) {
  const std::vector<double> one = {1.0}, none = {0.0};
  const Interval single = newcombe_by_clip(one, none, std::vector<int>{0});
  EXPECT_LT(single.low, 0.0);
  EXPECT_EQ(single.high, 1.0);
  // Five engines on one clip are not five clips.
  const Interval five =
      newcombe_by_clip(std::vector<double>(5, 1.0), std::vector<double>(5, 0.0), std::vector<int>(5, 0));
  EXPECT_NEAR(five.low, single.low, kAlgebra);
}

TEST(ByClip, ADifferenceOfOnePairAClipIsNewcombes) {
  std::vector<double> a, b;
  std::vector<int> clips;
  const auto add = [&](int pairs, double of_a, double of_b) {
    for (int i = 0; i < pairs; ++i) {
      a.push_back(of_a);
      b.push_back(of_b);
      clips.push_back(static_cast<int>(clips.size()));
    }
  };
  add(20, 1, 1);
  add(9, 1, 0);
  add(3, 0, 1);
  add(8, 0, 0);
  const Interval found = newcombe_by_clip(a, b, clips), expected = newcombe_paired(20, 9, 3, 8);
  EXPECT_NEAR(found.low, expected.low, kAlgebra);
  EXPECT_NEAR(found.high, expected.high, kAlgebra);
}

TEST(ByClip, RefusesWhatIsNoShare) {
  const std::vector<double> share = {0.5}, more = {1.5};
  const std::vector<int> one = {0}, two = {0, 1};
  EXPECT_SENTENCE(test::thrown_message<std::invalid_argument>([&] { wilson_by_clip({}, {}); }));
  EXPECT_SENTENCE(test::thrown_message<std::invalid_argument>([&] { wilson_by_clip(share, two); }));
  EXPECT_SENTENCE(test::thrown_message<std::invalid_argument>([&] { newcombe_by_clip(share, more, one); }));
}

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
