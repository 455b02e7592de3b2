#include <gmock/gmock.h>

#include "duet/core/require.h"
#include "duet/rows/merge/row_merge.h"
#include "tests/rows/rows.h"
#include "tests/support.h"

namespace duet {
namespace {

using test::episode;
using test::tiny_run;
using testing::ElementsAre;
using testing::IsEmpty;
using testing::SizeIs;

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

}  // namespace
}  // namespace duet
