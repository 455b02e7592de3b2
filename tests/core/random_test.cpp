#include <cmath>
#include <numbers>
#include <set>
#include <vector>

#include "duet/core/numbers.h"
#include "tests/support.h"

namespace duet {
namespace {

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

}  // namespace
}  // namespace duet
