#include "duet/core/numbers.h"

#include <array>
#include <cmath>
#include <limits>
#include <numbers>
#include <set>
#include <span>
#include <vector>

#include "duet/core/robot_state.h"
#include "tests/support.h"

namespace duet {
namespace {

using test::thrown_message;

constexpr double kAlgebra = 64 * std::numeric_limits<double>::epsilon();  // a few products of numbers near 1

std::vector<Pose> nasty_poses() {
  std::vector<Pose> poses = {{}};
  for (const double angle : {0.0, 1e-9, 1.0, std::numbers::pi - 1e-9, std::numbers::pi})
    for (const Eigen::Vector3d& axis : {Eigen::Vector3d(0, 0, 1), Eigen::Vector3d(1, 2, 3).normalized().eval()})
      poses.push_back({Eigen::Quaterniond(Eigen::AngleAxisd(angle, axis)), {angle, -1.0, 2.0}});
  Random random(1, 2);
  for (int i = 0; i < 20; ++i) {
    Eigen::Quaterniond R(random.normal(), random.normal(), random.normal(), random.normal());
    poses.push_back({R.normalized(), {random.normal(), random.normal(), random.normal()}});
    poses.push_back({Eigen::Quaterniond(-poses.back().R.coeffs()), poses.back().p});
  }
  return poses;
}

TEST(Pose, InverseTakesBack) {
  for (const Pose& X : nasty_poses()) {
    const Pose identity = X * X.inverse();
    EXPECT_NEAR(identity.p.norm(), 0.0, kAlgebra);
    EXPECT_NEAR(std::abs(identity.R.w()), 1.0, kAlgebra);
  }
}

TEST(Pose, ProductActsAsOneAfterTheOther) {
  const std::vector<Pose> poses = nasty_poses();
  const Eigen::Vector3d point(0.3, -0.7, 1.1);
  for (const Pose& a : poses)
    for (const Pose& b : poses) EXPECT_NEAR(((a * b) * point - a * (b * point)).norm(), 0.0, kAlgebra);
}

TEST(Pose, InterpolationMeetsItsEnds) {
  const std::vector<Pose> poses = nasty_poses();
  for (const Pose& a : poses)
    for (const Pose& b : poses) {
      EXPECT_NEAR(interpolate(a, b, 0.0).R.angularDistance(a.R), 0.0, 1e-7);  // arccos near 1: sqrt(epsilon)
      EXPECT_NEAR(interpolate(a, b, 1.0).R.angularDistance(b.R), 0.0, 1e-7);
      EXPECT_NEAR((interpolate(a, b, 0.25).p - (0.75 * a.p + 0.25 * b.p)).norm(), 0.0, kAlgebra);
    }
}

TEST(Pose, InterpolationTakesTheShorterArc) {
  const Pose a;
  Pose b{yaw_rotation(1.0), Eigen::Vector3d::Zero()};
  b.R.coeffs() *= -1.0;  // the same rotation, on the far side of the sphere
  EXPECT_NEAR(yaw_of(interpolate(a, b, 0.5).R), 0.5, kAlgebra);
}

TEST(Pose, YawIsTheHeading) {
  for (const double yaw : {-3.0, -1e-9, 0.0, 1.0, 3.1}) {
    EXPECT_NEAR(yaw_of(yaw_rotation(yaw)), yaw, kAlgebra);
    const Eigen::Quaterniond pitched = yaw_rotation(yaw) * Eigen::AngleAxisd(0.7, Eigen::Vector3d::UnitY());
    EXPECT_NEAR(yaw_of(pitched), yaw, kAlgebra);
  }
}

using Words = std::array<std::uint32_t, 4>;

// The known-answer tests of the authors' library Random123 (kat_vectors, philox4x32 10).
TEST(Philox, MatchesKnownAnswers) {
  constexpr std::uint32_t kOnes = 0xffffffff;
  EXPECT_EQ(philox({0, 0, 0, 0}, {0, 0}), (Words{0x6627e8d5, 0xe169c58d, 0xbc57ac4c, 0x9b00dbd8}));
  EXPECT_EQ(philox({kOnes, kOnes, kOnes, kOnes}, {kOnes, kOnes}),
            (Words{0x408f276d, 0x41c83b0e, 0xa20bc7c6, 0x6d5451fd}));
  EXPECT_EQ(philox({0x243f6a88, 0x85a308d3, 0x13198a2e, 0x03707344}, {0xa4093822, 0x299f31d0}),
            (Words{0xd16cfe09, 0x94fdcceb, 0x5001e420, 0x24126ea1}));
}

TEST(Random, CountsThroughTheBlocksOfItsStream) {
  const std::uint64_t seed = 0x1122334455667788, stream = 0x99aabbccddeeff00;
  Random random(seed, stream);
  for (std::uint32_t n = 0; n < 3; ++n) {
    const Words block = philox({n, 0, 0xddeeff00, 0x99aabbcc}, {0x55667788, 0x11223344});
    EXPECT_EQ(random.bits(), block[0] | static_cast<std::uint64_t>(block[1]) << 32);
    EXPECT_EQ(random.bits(), block[2] | static_cast<std::uint64_t>(block[3]) << 32);
  }
}

TEST(Random, StreamsDoNotShareValues) {
  std::set<std::uint64_t> seen;
  for (std::uint64_t seed = 0; seed < 10; ++seed)
    for (std::uint64_t stream = 0; stream < 10; ++stream) {
      Random random(seed, stream);
      for (int i = 0; i < 10; ++i) seen.insert(random.bits());
    }
  EXPECT_EQ(seen.size(), 1000u);  // a collision of 1000 64-bit numbers has a chance of 3e-14
}

TEST(Random, UniformFillsItsRangeEvenly) {
  Random random(3, 4);
  constexpr int kCount = 20000, kBins = 20;
  std::vector<int> bins(kBins, 0);
  for (int i = 0; i < kCount; ++i) {
    const double value = random.uniform(-2.0, 3.0);
    ASSERT_GE(value, -2.0);
    ASSERT_LT(value, 3.0);
    ++bins[static_cast<std::size_t>((value + 2.0) / 5.0 * kBins)];
  }
  double chi_square = 0.0;
  for (const int count : bins) chi_square += std::pow(count - kCount / kBins, 2) / (kCount / kBins);
  EXPECT_LT(chi_square, 50.8);  // chance 1e-4 with 19 degrees of freedom; the numbers are fixed
}

TEST(Random, UniformStaysBelowItsUpperEndWhereRoundingWouldReachIt) {
  Random random(1, 1);
  const double low = 1.0, high = std::nextafter(1.0, 2.0);
  for (int i = 0; i < 100; ++i) EXPECT_EQ(random.uniform(low, high), low);
}

TEST(Random, NormalHasItsMoments) {
  Random random(5, 6);
  constexpr int kCount = 40000;
  double sum = 0.0, squares = 0.0, fourth = 0.0;
  for (int i = 0; i < kCount; ++i) {
    const double value = random.normal();
    ASSERT_TRUE(std::isfinite(value));
    sum += value, squares += value * value, fourth += value * value * value * value;
  }
  const double sigma = 4.0 / std::sqrt(kCount);  // four standard errors
  EXPECT_NEAR(sum / kCount, 0.0, sigma);
  EXPECT_NEAR(squares / kCount, 1.0, sigma * std::numbers::sqrt2);
  EXPECT_NEAR(fourth / kCount, 3.0, sigma * std::sqrt(96.0));
}

TEST(Random, BelowReachesEachValueAndNoOther) {
  Random random(7, 8);
  std::vector<int> counts(6, 0);
  for (int i = 0; i < 6000; ++i) {
    const int value = random.below(6);
    ASSERT_TRUE(0 <= value && value < 6);
    ++counts[static_cast<std::size_t>(value)];
  }
  for (const int count : counts) EXPECT_NEAR(count, 1000, 4 * std::sqrt(1000 * 5.0 / 6.0));
  EXPECT_EQ(random.below(1), 0);
}

TEST(Random, BelowRefusesAnEmptyRange) {
  Random random(1, 1);
  EXPECT_SENTENCE(test::thrown_message<std::invalid_argument>([&] { random.below(0); }));
  EXPECT_THROW(random.below(-1), std::invalid_argument);
}

TEST(Random, ChanceOfZeroAndOneAreCertain) {
  Random random(1, 1);
  for (int i = 0; i < 100; ++i) {
    EXPECT_FALSE(random.chance(0.0));
    EXPECT_TRUE(random.chance(1.0));
  }
}

TEST(StreamKey, DependsOnEachPartAndOnWhereItEnds) {
  const std::uint64_t key = stream_key({"suite", "hug", "1"});
  EXPECT_EQ(key, stream_key({"suite", "hug", "1"}));
  EXPECT_NE(key, stream_key({"suite", "hug", "2"}));
  EXPECT_NE(key, stream_key({"suite", "hu", "g1"}));
  EXPECT_NE(key, stream_key({"suite", "hug1"}));
  EXPECT_NE(stream_key({}), stream_key({""}));
}

// SHA-256 of the empty text begins with e3b0c44298fc1c14.
TEST(StreamKey, IsTheFirstEightBytesOfTheDigest) { EXPECT_EQ(stream_key({}), 0xe3b0c44298fc1c14u); }

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
