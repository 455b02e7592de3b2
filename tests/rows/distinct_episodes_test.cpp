
#include "duet/core/require.h"
#include "duet/report/ranking/comparison.h"
#include "duet/report/ranking/policy_groups.h"
#include "duet/rows/groups/row_groups.h"
#include "tests/rows/rows.h"
#include "tests/support.h"

namespace duet {
namespace {

using test::episode;

EpisodeRow repeat(int number, const std::string& state_hash, const std::string& policy = "replay") {
  EpisodeRow row = episode(policy, "hug", 0, false, policy == "null" ? "null" : "main");
  row.episode = number;
  row.seed = static_cast<std::uint64_t>(number);
  row.state_hash = state_hash;
  row.started_at = "2026-01-02T03:04:0" + std::to_string(number) + "Z";
  row.key = episode_key(row);
  return row;
}

TEST(DistinctEpisodes, AnEpisodeThatRepeatsCountsOnce) {
  std::vector<EpisodeRow> rows;
  for (int i = 0; i < 9; ++i) rows.push_back(repeat(i, "same"));
  const std::vector<const EpisodeRow*> distinct = distinct_episodes(rows);
  ASSERT_EQ(distinct.size(), 1U);
  EXPECT_EQ(distinct[0]->episode, 0);
  const LeaderboardEntry entry = leaderboard(rows).front();
  EXPECT_EQ(entry.n, 1);
  EXPECT_GT(entry.interval.high, 0.79);  // Wilson of 0 of 1, not of 0 of 9
  EXPECT_EQ(rows_of_policies(rows).begin()->second.at("clean").size(), 1U);
}

TEST(DistinctEpisodes, OtherStatesAreOtherEpisodes) {
  EXPECT_EQ(distinct_episodes({repeat(0, "a"), repeat(1, "b"), repeat(2, "a")}).size(), 2U);
}

TEST(DistinctEpisodes, OtherVerdictsAreOtherEpisodes) {
  // A partner that moves in another way leaves a blind robot's states as they were, but not what came of them.
  EpisodeRow lucky = repeat(1, "a");
  lucky.success = true;
  EXPECT_EQ(distinct_episodes({repeat(0, "a"), lucky}).size(), 2U);
}

TEST(DistinctEpisodes, RowsWithoutAStateHashRepeatNothing) {
  EXPECT_EQ(distinct_episodes({repeat(0, ""), repeat(1, "")}).size(), 2U);
}

TEST(DistinctEpisodes, PairedTestsCountThemOnceToo) {
  std::vector<EpisodeRow> a, b;
  for (int i = 0; i < 6; ++i) {
    a.push_back(repeat(i, "a", "good"));
    a.back().success = true;
    b.push_back(repeat(i, "b", "bad"));
  }
  const Estimate p = *find_estimate(comparison_analysis(a, b).estimates, {.task = "all", .name = "p"});
  EXPECT_EQ(p.n, 1);
  EXPECT_EQ(p.value, 1.0);  // McNemar of one pair, not of six (0.03)
}

TEST(DistinctEpisodes, TheSameNumberTwiceIsStillRefused) {
  EXPECT_SENTENCE(test::thrown_message<InputError>([] { leaderboard({repeat(0, "a"), repeat(0, "a")}); }));
}

TEST(DistinctEpisodes, TheNoteSaysHowManyAndOfWhat) {
  EXPECT_EQ(repeats_note({repeat(0, "a"), repeat(1, "b")}), "");
  EXPECT_SENTENCE(
      repeats_note({repeat(0, "a"), repeat(1, "a"), repeat(2, "a"), repeat(0, "n", "null"), repeat(1, "n", "null")}));
}

TEST(DistinctEpisodes, OneNameForTwoPoliciesIsNoTable) {
  EpisodeRow first = repeat(0, "a"), second = repeat(1, "b");
  first.policy_digest = std::string(64, 'a');
  second.policy_digest = std::string(64, 'b');
  EXPECT_SENTENCE(test::thrown_message<InputError>([&] { leaderboard({first, second}); }));
  second.policy_digest = first.policy_digest;
  second.controller_digest = "c";
  EXPECT_SENTENCE(test::thrown_message<InputError>([&] { leaderboard({first, second}); }));
  second = repeat(1, "b");
  second.policy_digest = first.policy_digest;
  second.detectors = "2";
  EXPECT_SENTENCE(test::thrown_message<InputError>([&] { leaderboard({first, second}); }));
}

}  // namespace
}  // namespace duet
