#include <gmock/gmock.h>

#include "duet/core/require.h"
#include "duet/report/ranking/comparison.h"
#include "duet/report/ranking/policy_groups.h"
#include "duet/rows/groups/row_groups.h"
#include "duet/rows/merge/row_merge.h"
#include "tests/rows/rows.h"
#include "tests/support.h"

namespace duet {
namespace {

using test::episode;
using test::tiny_run;
using ::testing::ElementsAre;
using ::testing::IsEmpty;
using ::testing::SizeIs;

// The run of one person: an own policy and the null arm.
duet::Run run_of(const std::string& path, const std::string& policy, const std::string& when = "2026-01-02") {
  duet::Run run;
  run.path = path;
  run.info = tiny_run();
  run.info.policies = {{"null", std::string(64, '0')}, {policy, std::string(64, 'a')}};
  run.info.controllers = {{"vmc", std::string(64, 'c')}};
  run.info.environment = {{"machine", path}};
  for (int i = 0; i < 3; ++i) {
    for (const bool null_arm : {false, true}) {
      EpisodeRow row = episode(null_arm ? "null" : policy, "hug", i, !null_arm, null_arm ? "null" : "main");
      row.policy_digest = run.info.policies.at(row.policy);
      row.controller_digest = run.info.controllers.at("vmc");
      row.started_at = when;
      row.key = episode_key(row);
      run.rows.push_back(row);
    }
  }
  return run;
}

std::vector<nlohmann::json> rows_of(const duet::Run& run) {
  std::vector<nlohmann::json> rows;
  for (const EpisodeRow& row : run.rows) rows.push_back(to_json(row));
  return rows;
}

void expect_same(const duet::Run& a, const duet::Run& b) {
  EXPECT_EQ(rows_of(a), rows_of(b));
  EXPECT_EQ(a.info.policies, b.info.policies);
  EXPECT_EQ(a.info.environment, b.info.environment);
  EXPECT_EQ(a.info.created_at, b.info.created_at);
}

TEST(MergedRuns, TwoPeoplesPoliciesStandBesideOneNullArm) {
  const MergedRuns both = merge_loaded({run_of("a", "mine"), run_of("b", "yours")});
  EXPECT_THAT(both.conflicts, IsEmpty());
  EXPECT_EQ(both.folded, 3);
  EXPECT_THAT(both.run.rows, SizeIs(9));
  EXPECT_THAT(both.run.info.policies, SizeIs(3));
}

TEST(MergedRuns, DoesNotDependOnTheOrderOfTheRuns) {
  const duet::Run a = run_of("a", "mine", "2026-01-02"), b = run_of("b", "yours", "2026-01-01");
  expect_same(merge_loaded({a, b}).run, merge_loaded({b, a}).run);
}

TEST(MergedRuns, DoesNotDependOnHowTheRunsAreGrouped) {
  const duet::Run a = run_of("a", "mine", "2026-01-03"), b = run_of("b", "yours", "2026-01-01"),
                  c = run_of("c", "theirs", "2026-01-02");
  const duet::Run left = merge_loaded({merge_loaded({a, b}).run, c}).run,
                  right = merge_loaded({a, merge_loaded({b, c}).run}).run;
  expect_same(left, right);
  expect_same(left, merge_loaded({a, b, c}).run);
}

TEST(MergedRuns, OfARunWithItselfIsThatRun) {
  const duet::Run a = merge_loaded({run_of("a", "mine")}).run;
  const MergedRuns twice = merge_loaded({a, a});
  EXPECT_EQ(twice.folded, 6);
  expect_same(twice.run, a);
}

TEST(MergedRuns, UnequalRowsOfOneEpisodeAreNamedWithTheFieldsAndBothRuns) {
  duet::Run other = run_of("b", "yours");
  other.rows[1].state_hash = "another";  // of the null arm
  other.rows[1].success = true;
  const MergedRuns both = merge_loaded({run_of("a", "mine"), other});
  EXPECT_THAT(both.conflicts,
              ElementsAre("hug-0 0 of mujoco/vmc/null clean is not the same in 'a' and 'b': state_hash: \"\", "
                          "\"another\"; success: false, true"));
  EXPECT_SENTENCE(test::thrown_message<InputError>([&] { united({run_of("a", "mine"), other}); }));
}

TEST(MergedRuns, ATimeOutGivesWayInEitherOrder) {
  duet::Run late = run_of("b", "mine");
  late.rows[0].outcome = late.rows[1].outcome = Outcome::kTimedOut;
  late.rows[0].success = false;
  duet::Run later = late;
  later.rows[1].outcome = Outcome::kError;
  for (const std::vector<duet::Run>& runs :
       {std::vector{run_of("a", "mine"), late}, std::vector{late, run_of("a", "mine")},
        std::vector{later, late, run_of("a", "mine")}}) {
    const MergedRuns both = merge_loaded(runs);
    EXPECT_THAT(both.conflicts, IsEmpty());
    EXPECT_THAT(both.run.rows, testing::Each(testing::Field(&EpisodeRow::outcome, Outcome::kOk)));
    EXPECT_EQ(both.folded + both.superseded, 6 * (static_cast<int>(runs.size()) - 1));
  }
  EXPECT_THAT(merge_loaded({late, late}).conflicts, IsEmpty());
}

TEST(MergedRuns, OneNameForTwoPoliciesIsRefusedWithBothDigests) {
  duet::Run other = run_of("b", "mine");
  other.info.policies["mine"] = std::string(64, 'b');
  for (EpisodeRow& row : other.rows)
    if (row.policy == "mine") row.policy_digest = std::string(64, 'b');
  for (EpisodeRow& row : other.rows) row.key = episode_key(row);
  EXPECT_SENTENCE(test::thrown_message<InputError>([&] { merge_loaded({run_of("a", "mine"), other}); }));
}

TEST(MergedRuns, RunsOfTwoSuitesAreRefused) {
  duet::Run other = run_of("b", "yours");
  other.info.suite_hash = "fedcba9876543210";
  EXPECT_SENTENCE(test::thrown_message<InputError>([&] { merge_loaded({run_of("a", "mine"), other}); }));
}

TEST(MergedRuns, APolicyThatOneOfTheRunsLacksTakesTheOthersDigest) {
  duet::Run other = run_of("b", "yours");
  other.info.policies["mine"] = "";  // its files were not there, and no row is of it
  EXPECT_EQ(merge_loaded({other, run_of("a", "mine")}).run.info.policies.at("mine"), std::string(64, 'a'));
}

TEST(MergedRuns, IsPartialWhereOneOfTheRunsIs) {
  duet::Run whole = run_of("a", "mine"), partial = run_of("b", "yours");
  whole.info.plan = RunPlan{.episodes = 6, .asked = 6, .parts = {EpisodeFilter()}};
  partial.info.plan = RunPlan{.episodes = 10, .asked = 10, .parts = {EpisodeFilter()}};
  const duet::Run both = merge_loaded({whole, partial}).run;
  EXPECT_TRUE(is_partial(both));
  EXPECT_EQ(both.info.plan->asked, 9 + 4);
  EXPECT_FALSE(is_partial(merge_loaded({whole, whole}).run));
  EXPECT_EQ(merge_loaded({partial, whole}).run.info.plan, both.info.plan);
  ASSERT_EQ(both.info.plan->parts.size(), 2U);
  EXPECT_EQ(both.info.plan->parts[0].policies, std::vector<std::string>{"mine"});
  EXPECT_FALSE(merge_loaded({whole, run_of("b", "yours")}).run.info.plan.has_value());  // one does not say
}

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
