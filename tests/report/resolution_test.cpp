#include "duet/report/ranking/resolution.h"

#include <gmock/gmock.h>

#include "tests/report/figures.h"
#include "tests/support.h"

namespace duet {
namespace {

using test::figure;
using test::thrown_message;
using testing::AllOf;
using testing::HasSubstr;
using testing::Not;

Comparison compared(long both, long only_a, long only_b, double p_holm) {
  Comparison comparison;
  comparison.group = "mujoco/vmc/a vs b hug";
  comparison.both = both;
  comparison.only_a = only_a;
  comparison.only_b = only_b;
  comparison.pairs = both + only_a + only_b;
  const double pairs = static_cast<double>(comparison.pairs);
  comparison.difference = static_cast<double>(only_a - only_b) / pairs;
  comparison.interval = comparison.cluster_interval = newcombe_paired(both, only_a, only_b, 0);
  comparison.clips = comparison.pairs;
  comparison.p_holm = p_holm;
  comparison.minimum_detectable =
      minimum_detectable_difference_paired(static_cast<double>(only_a + only_b) / pairs, comparison.pairs);
  return comparison;
}

TEST(Resolution, VerdictOfAFixedNumberOfPairs) {
  EXPECT_EQ(verdict_of(compared(80, 20, 0, 0.05), 0.05), PairVerdict::kBetter);
  EXPECT_EQ(verdict_of(compared(80, 0, 20, 0.01), 0.05), PairVerdict::kWorse);
  EXPECT_EQ(verdict_of(compared(80, 20, 0, 0.06), 0.05), PairVerdict::kUndecided);
  EXPECT_EQ(verdict_of(compared(2000, 5, 4, 1.0), 0.05), PairVerdict::kSame);
  EXPECT_EQ(verdict_of(compared(2000, 30, 0, 0.001), 0.05), PairVerdict::kSame);  // not zero, and too small to matter
  EXPECT_EQ(verdict_of(compared(2000, 30, 0, 0.001), 0.01), PairVerdict::kBetter);
}

TEST(Resolution, NeededNumbersAreTheSmallestThatShowTheDifference) {
  for (const double discordance : {0.02, 0.1, 0.3}) {
    const long n = needed_pairs(discordance, 0.05);
    EXPECT_LE(minimum_detectable_difference_paired(discordance, n), 0.05);
    EXPECT_GT(minimum_detectable_difference_paired(discordance, n - 1), 0.05);
  }
  const long n = needed_episodes(0.85, 0.05);
  EXPECT_EQ(n, 801);  // "about 800" in docs/reading-the-leaderboard.md
  EXPECT_LE(minimum_detectable_difference(0.85, n), 0.05);
  EXPECT_GT(minimum_detectable_difference(0.85, n - 1), 0.05);
  EXPECT_THAT(thrown_message<std::invalid_argument>([] { needed_pairs(0.1, 0.0); }),
              HasSubstr("difference: expected a number in (0, 1), found 0"));
}

TEST(Resolution, ACautionNamesThePairsThatAreNeeded) {
  const std::vector<Comparison> small = {compared(100, 12, 14, 1.0)};
  ASSERT_EQ(resolution_notes(small, 0.05).size(), 1U);
  EXPECT_THAT(resolution_notes(small, 0.05)[0], AllOf(HasSubstr("126 pairs cannot resolve 5 points"),
                                                      HasSubstr(std::to_string(needed_pairs(26.0 / 126.0, 0.05)))));
  EXPECT_TRUE(resolution_notes(small, 0.5).empty());
  EXPECT_TRUE(resolution_notes(std::vector<Comparison>{compared(80, 20, 0, 0.01)}, 0.05).empty());  // decided
  EXPECT_THAT(analysis_markdown(comparison_analysis(small)), AllOf(HasSubstr("Caution: "), HasSubstr("| undecided")));
  EXPECT_THAT(analysis_markdown(comparison_analysis(small, 0.5)),
              AllOf(Not(HasSubstr("Caution: ")), HasSubstr("| same within the margin")));
  EXPECT_EQ(figure(comparison_analysis(small), {.name = "verdict"}).text, "undecided");
  EXPECT_EQ(figure(comparison_analysis(small, 0.5), {.name = "margin"}).value, 0.5);
}

TEST(Resolution, AnArmThatIsTooSmallSaysSo) {
  LeaderboardEntry arm;
  arm.engine = "mujoco";
  arm.controller = "vmc";
  arm.policy = "dp";
  arm.perturbation = "clean";
  arm.task = "all";
  arm.n = 800;
  arm.success = 0.85;
  EXPECT_THAT(resolution_notes(std::vector<LeaderboardEntry>{arm}, 0.05).at(0),
              HasSubstr("mujoco/vmc/dp clean: 800 distinct episodes cannot resolve 5 points to another arm; unpaired "
                        "about 801 would"));
  arm.n = 801;
  EXPECT_TRUE(resolution_notes(std::vector<LeaderboardEntry>{arm}, 0.05).empty());
  arm.n = 10;
  arm.task = "hug";
  EXPECT_TRUE(resolution_notes(std::vector<LeaderboardEntry>{arm}, 0.05).empty());
}

}  // namespace
}  // namespace duet
