#include "duet/statistics/sequential_test.h"

#include <cmath>
#include <cstdio>
#include <functional>
#include <vector>

#include "duet/core/numbers.h"
#include "tests/support.h"

namespace duet {
namespace {

using test::thrown_message;

// Difference of one pair: A alone succeeds, B alone, or neither nor both.
double pair(Random& random, double only_a, double only_b) {
  const double u = random.uniform();
  return u < only_a ? 1.0 : u < only_a + only_b ? -1.0 : 0.0;
}

struct Rates {
  double only_a, only_b;
};

// Pairs of strata in rounds, to `pairs` in all; `look` sees the test after every round and ends it by false.
void play(Random& random, const std::vector<Rates>& strata, int pairs,
          const std::function<bool(SequentialTest&)>& look) {
  SequentialTest test;
  std::vector<double> round(strata.size());
  for (int n = 0; n < pairs; n += static_cast<int>(strata.size())) {
    for (std::size_t s = 0; s < strata.size(); ++s) round[s] = pair(random, strata[s].only_a, strata[s].only_b);
    test.add_round(round);
    if (!look(test)) return;
  }
}

// Share of `runs` that ever show a difference, looked at after every round.
double share_decided(const std::vector<Rates>& strata, int pairs, int runs, double alpha, std::uint64_t seed) {
  int decided = 0;
  for (int run = 0; run < runs; ++run) {
    Random random(seed, static_cast<std::uint64_t>(run));
    play(random, strata, pairs, [&](const SequentialTest& test) {
      const bool shown = test.anytime_p() <= alpha;
      decided += shown ? 1 : 0;
      return !shown;
    });
  }
  return static_cast<double>(decided) / runs;
}

TEST(SequentialTest, TypeOneErrorHoldsInTenThousandNullRunsLookedAtAfterEveryRound) {
  const std::vector<Rates> equal(6, Rates{0.1, 0.1});
  const double error = share_decided(equal, 400, 10000, 0.05, 1);
  std::printf("type I error at .05, 10000 null runs of 400 pairs, a look after every 6: %.4f\n", error);
  EXPECT_LE(error, 0.05);
  EXPECT_GT(error, 0.005);  // a test that never speaks holds every level
}

TEST(SequentialTest, TypeOneErrorHoldsWhereStrataDifferButTheirMeanDoesNot) {
  const std::vector<Rates> opposed = {{0.3, 0.0}, {0.0, 0.3}, {0.2, 0.1}, {0.1, 0.2}};
  const double error = share_decided(opposed, 400, 4000, 0.05, 2);
  std::printf("type I error at .05 with opposed strata, 4000 null runs: %.4f\n", error);
  EXPECT_LE(error, 0.05);
}

TEST(SequentialTest, IntervalHoldsTheTruthAtEveryLook) {
  const double truth = 0.05;
  const double limit = std::log(2.0 / 0.05);
  int missed = 0;
  constexpr int kRuns = 2000;
  for (int run = 0; run < kRuns; ++run) {
    Random random(3, static_cast<std::uint64_t>(run));
    play(random, {{0.125, 0.075}, {0.2, 0.15}}, 400, [&](const SequentialTest& test) {
      const bool out = test.log_capital(truth, true) >= limit || test.log_capital(truth, false) >= limit;
      missed += out ? 1 : 0;
      return !out;
    });
  }
  std::printf("coverage of the 95 %% interval at all 200 looks at once: %.4f\n", 1.0 - 1.0 * missed / kRuns);
  EXPECT_LE(missed, kRuns / 20);
}

TEST(SequentialTest, PowerForFiveAndTenPointsAtEightHundredPairs) {
  for (const double discordance : {0.1, 0.2}) {
    for (const double points : {0.05, 0.1}) {
      int pairs = 0, decided = 0;
      constexpr int kRuns = 300;
      for (int run = 0; run < kRuns; ++run) {
        Random random(4, static_cast<std::uint64_t>(run));
        const Rates rates{0.5 * (discordance + points), 0.5 * (discordance - points)};
        play(random, std::vector<Rates>(4, rates), 800, [&](const SequentialTest& test) {
          pairs += 4;
          const bool shown = test.anytime_p() <= 0.05;
          decided += shown ? 1 : 0;
          return !shown;
        });
      }
      std::printf("%g points, %g %% of pairs disagree, 800 pairs: power %.3f, pairs needed %.0f in the mean\n",
                  100 * points, 100 * discordance, 1.0 * decided / kRuns, 1.0 * pairs / kRuns);
      const double least = points > 0.06 ? 0.99 : discordance < 0.15 ? 0.8 : 0.4;
      EXPECT_GT(decided, kRuns * least);
    }
  }
}

TEST(SequentialTest, AFewRoundsHaveTheValuesOfTheClosedForm) {
  SequentialTest test;
  EXPECT_EQ(test.e_value(), 1.0);
  EXPECT_EQ(test.anytime_p(), 1.0);
  EXPECT_TRUE(std::isnan(test.difference()));
  EXPECT_EQ(test.interval(0.05).low, -1.0);
  EXPECT_EQ(test.interval(0.05).high, 1.0);
  test.add_round(std::vector<double>{1.0});
  // Against 0 a win multiplies by 1 + l on one side and 1 - l on the other.
  double up = 0.0;
  for (const double stake : {0.02, 0.04, 0.08, 0.16, 0.32, 0.64, 0.95}) up += (1.0 + stake) / 7.0;
  EXPECT_NEAR(std::exp(test.log_capital(0.0, true)), up, 1e-12);
  EXPECT_NEAR(std::exp(test.log_capital(0.0, false)), 2.0 - up, 1e-12);
  EXPECT_NEAR(test.e_value(), 1.0, 1e-12);
  test.add_round(std::vector<double>{-1.0, 0.0});
  EXPECT_EQ(test.observations(), 3);
  EXPECT_EQ(test.difference(), 0.0);
}

TEST(SequentialTest, MirroredRunsHaveMirroredIntervals) {
  SequentialTest test, mirrored;
  Random random(5, 1);
  for (int i = 0; i < 200; ++i) {
    const double x = pair(random, 0.3, 0.1);
    test.add_round(std::vector<double>{x});
    mirrored.add_round(std::vector<double>{-x});
  }
  const Interval interval = test.interval(0.05), other = mirrored.interval(0.05);
  EXPECT_NEAR(interval.low, -other.high, 1e-9);
  EXPECT_NEAR(interval.high, -other.low, 1e-9);
  EXPECT_LT(interval.low, test.difference());
  EXPECT_GT(interval.high, test.difference());
  EXPECT_GT(interval.low, 0.0);
  EXPECT_NEAR(test.log_capital(interval.low, true), std::log(40.0), 1e-6);
  EXPECT_NEAR(test.log_capital(interval.high, false), std::log(40.0), 1e-6);
  EXPECT_LT(test.interval(0.01).low, interval.low);
}

TEST(SequentialTest, PKeepsTheLargestEvidence) {
  SequentialTest test;
  for (int i = 0; i < 30; ++i) test.add_round(std::vector<double>{1.0});
  const double p = test.anytime_p();
  EXPECT_NEAR(p, 1.0 / test.e_value(), 1e-12);
  for (int i = 0; i < 30; ++i) test.add_round(std::vector<double>{-1.0});
  EXPECT_EQ(test.anytime_p(), p);
  EXPECT_LT(test.e_value(), 1.0 / p);
}

TEST(SequentialTest, RefusesWhatIsNoDifference) {
  SequentialTest test;
  EXPECT_SENTENCE(thrown_message<std::invalid_argument>([&] { test.add_round(std::vector<double>{0.0, 1.5}); }));
  EXPECT_EQ(test.observations(), 0);
  EXPECT_SENTENCE(thrown_message<std::invalid_argument>([&] { static_cast<void>(test.interval(1.0)); }));
  EXPECT_SENTENCE(thrown_message<std::invalid_argument>([&] { static_cast<void>(test.log_capital(-1.0, true)); }));
}

TEST(SequentialDecision, IsReadFromTheInterval) {
  EXPECT_EQ(verdict_of({0.01, 0.2}, 0.05), SequentialDecision::kBetter);
  EXPECT_EQ(verdict_of({-0.2, -0.01}, 0.05), SequentialDecision::kWorse);
  EXPECT_EQ(verdict_of({-0.04, 0.04}, 0.05), SequentialDecision::kSame);
  EXPECT_EQ(verdict_of({0.01, 0.04}, 0.05), SequentialDecision::kSame);  // not zero, and too small to matter
  EXPECT_EQ(verdict_of({-0.05, 0.04}, 0.05), SequentialDecision::kUndecided);
  EXPECT_EQ(verdict_of({-0.04, 0.05}, 0.05), SequentialDecision::kUndecided);
  EXPECT_EQ(verdict_of({0.0, 0.2}, 0.05), SequentialDecision::kUndecided);
  EXPECT_EQ(verdict_of({-0.2, 0.0}, 0.05), SequentialDecision::kUndecided);
  EXPECT_EQ(to_string(SequentialDecision::kBetter), "better");
  EXPECT_EQ(to_string(SequentialDecision::kWorse), "worse");
  EXPECT_EQ(to_string(SequentialDecision::kSame), "same within the margin");
  EXPECT_EQ(to_string(SequentialDecision::kUndecided), "undecided");
  EXPECT_SENTENCE(thrown_message<std::invalid_argument>([] { verdict_of({0.0, 0.0}, 0.0); }));
}

}  // namespace
}  // namespace duet
