#include "duet/report/ranking/leaderboard.h"

#include <gmock/gmock.h>

#include <algorithm>
#include <cmath>

#include "duet/core/require.h"
#include "duet/report/ranking/leaderboard_rows.h"
#include "tests/report/estimates.h"
#include "tests/rows/rows.h"
#include "tests/support.h"

namespace duet {
namespace {

using test::episode;
using test::estimate;
using test::estimates_like;
using test::thrown_message;
using testing::AllOf;
using testing::HasSubstr;
using testing::Not;

LeaderboardEntry entry_of(const std::vector<LeaderboardEntry>& entries, const std::string& policy,
                          const std::string& task) {
  const auto found = std::find_if(entries.begin(), entries.end(), [&](const LeaderboardEntry& entry) {
    return entry.policy == policy && entry.task == task;
  });
  if (found == entries.end()) throw std::runtime_error("no entry " + policy + " " + task);
  return *found;
}

// 20 hugs and 10 waves of "replay" and of the null arm. Hug: 16 and 2 succeed, waves: 9 and 5.
std::vector<EpisodeRow> small_benchmark() {
  std::vector<EpisodeRow> rows;
  for (int i = 0; i < 20; ++i) {
    rows.push_back(episode("replay", "hug", i, i < 16));
    rows.push_back(episode("null", "hug", i, i < 2, "null"));
  }
  for (int i = 0; i < 10; ++i) {
    rows.push_back(episode("replay", "wave", i, i < 9));
    rows.push_back(episode("null", "wave", i, i >= 5, "null"));
  }
  return rows;
}

std::size_t columns(const std::string& line) {
  return static_cast<std::size_t>(std::count(line.begin(), line.end(), '|'));
}

std::string text_of(const std::vector<LeaderboardEntry>& entries) {
  return analysis_markdown(leaderboard_analysis(entries));
}

std::string latex_of(const std::vector<LeaderboardEntry>& entries) {
  return analysis_latex(leaderboard_analysis(entries));
}

TEST(Leaderboard, CountsAndIntervalsPerTaskAndOverAll) {
  const std::vector<LeaderboardEntry> entries = leaderboard(small_benchmark());
  ASSERT_EQ(entries.size(), 6U);
  const LeaderboardEntry hug = entry_of(entries, "replay", "hug");
  EXPECT_EQ(hug.n, 20);
  EXPECT_EQ(hug.k, 16);
  EXPECT_DOUBLE_EQ(hug.success, 0.8);
  // Three draws a clip: no surer than seven clips.
  EXPECT_TRUE(hug.by_clip);
  EXPECT_LE(hug.interval.low, wilson_of(0.8 * 7, 7).low);
  EXPECT_GE(hug.interval.high, wilson_of(0.8 * 7, 7).high);
  const LeaderboardEntry all = entry_of(entries, "replay", "all");
  EXPECT_EQ(all.n, 30);
  EXPECT_DOUBLE_EQ(all.success, 25.0 / 30.0);  // micro average: each episode counts the same
}

TEST(Leaderboard, OneDrawAClipHasIntervalsOverEpisodes) {
  std::vector<EpisodeRow> rows = small_benchmark();
  for (EpisodeRow& row : rows) row.clip = row.task + "_" + std::to_string(row.episode);
  const std::vector<LeaderboardEntry> entries = leaderboard(rows);
  const LeaderboardEntry hug = entry_of(entries, "replay", "hug"), wave = entry_of(entries, "replay", "wave");
  EXPECT_FALSE(hug.by_clip);
  EXPECT_EQ(hug.interval.low, wilson(16, 20).low);
  EXPECT_EQ(hug.interval.high, wilson(16, 20).high);
  EXPECT_EQ(wave.lift_interval.low, newcombe_paired(4, 5, 1, 0).low);
  EXPECT_EQ(wave.lift_interval.high, newcombe_paired(4, 5, 1, 0).high);
  EXPECT_THAT(text_of(entries), Not(HasSubstr("several episodes")));
  EXPECT_SENTENCE(text_of(leaderboard(small_benchmark())));
}

TEST(Leaderboard, LiftIsPairedWithTheNullArm) {
  const std::vector<LeaderboardEntry> entries = leaderboard(small_benchmark());
  const LeaderboardEntry wave = entry_of(entries, "replay", "wave");
  EXPECT_EQ(wave.pairs, 10);
  EXPECT_DOUBLE_EQ(wave.null_success, 0.5);
  EXPECT_DOUBLE_EQ(wave.lift, 0.4);
  // Waves 5 to 8 succeed in both arms, 0 to 4 with the policy only, 9 with the null arm only; three draws a clip.
  const Interval episodes = newcombe_paired(4, 5, 1, 0);
  EXPECT_LT(wave.lift_interval.low, episodes.low);
  EXPECT_GT(wave.lift_interval.high, episodes.high);
  const LeaderboardEntry null_wave = entry_of(entries, "null", "wave");
  EXPECT_EQ(null_wave.arm, "null");
  EXPECT_TRUE(std::isnan(null_wave.lift));
}

TEST(Leaderboard, LiftCoversOnlyEpisodesThatTheNullArmHas) {
  std::vector<EpisodeRow> rows = small_benchmark();
  std::erase_if(rows, [](const EpisodeRow& row) { return row.arm == "null" && row.task == "hug" && row.episode >= 4; });
  const LeaderboardEntry hug = entry_of(leaderboard(rows), "replay", "hug");
  EXPECT_EQ(hug.n, 20);
  EXPECT_EQ(hug.pairs, 4);
  EXPECT_DOUBLE_EQ(hug.null_success, 0.5);
  EXPECT_DOUBLE_EQ(hug.lift, 0.5);
  std::erase_if(rows, [](const EpisodeRow& row) { return row.arm == "null"; });
  const std::vector<LeaderboardEntry> alone = leaderboard(rows);
  EXPECT_TRUE(std::isnan(entry_of(alone, "replay", "hug").lift));
  EXPECT_SENTENCE(text_of(alone));
}

TEST(Leaderboard, ANullArmUnderAnotherConditionDoesNotPair) {
  for (std::string EpisodeRow::*field : {&EpisodeRow::engine, &EpisodeRow::controller, &EpisodeRow::perturbation}) {
    std::vector<EpisodeRow> rows = {episode("replay", "hug", 0, true), episode("null", "hug", 0, false, "null")};
    rows[1].*field = "other";
    EXPECT_EQ(entry_of(leaderboard(rows), "replay", "hug").pairs, 0);
  }
}

TEST(Leaderboard, WhatDidNotEndWellFailsAndIsShown) {
  std::vector<EpisodeRow> rows;
  for (const Outcome outcome :
       {Outcome::kOk, Outcome::kFell, Outcome::kDiverged, Outcome::kTimedOut, Outcome::kError, Outcome::kUnsupported}) {
    rows.push_back(episode("replay", "hug", static_cast<int>(rows.size()), true));
    rows.back().outcome = outcome;
    Verdict verdict;
    verdict.success = true;
    verdict.version = "robot";
    verdict.thresholds = "strict";
    rows.back().verdicts = {verdict};
  }
  rows.push_back(episode("replay", "hug", 6, true));
  rows.back().success.reset();
  const LeaderboardEntry entry = entry_of(leaderboard(rows), "replay", "hug");
  EXPECT_EQ(entry.n, 7);
  EXPECT_EQ(entry.k, 1);  // who fell after it had succeeded has failed
  EXPECT_EQ(entry.fell, 1);
  EXPECT_EQ(entry.diverged, 1);
  EXPECT_EQ(entry.timed_out, 1);
  EXPECT_EQ(entry.errors, 1);
  EXPECT_EQ(entry.unsupported, 1);
  EXPECT_EQ(entry.unjudged, 1);
  EXPECT_DOUBLE_EQ(entry.other_success.at("robot/strict"), 1.0 / 7.0);
  EXPECT_SENTENCE(text_of(leaderboard(rows)));
}

TEST(Leaderboard, MetricsAreMeansOverEpisodesThatHaveThem) {
  std::vector<EpisodeRow> rows = {episode("replay", "hug", 0, true), episode("replay", "hug", 1, true),
                                  episode("replay", "wave", 2, true)};
  rows[0].metrics = {{"jpe", 1.0}, {"lar", 5.0}};
  rows[1].metrics = {{"jpe", 2.0}};
  rows[2].metrics = {{"jpe", 6.0}};
  const std::vector<LeaderboardEntry> entries = leaderboard(rows);
  EXPECT_DOUBLE_EQ(entry_of(entries, "replay", "hug").metrics.at("jpe"), 1.5);
  EXPECT_DOUBLE_EQ(entry_of(entries, "replay", "hug").metrics.at("lar"), 5.0);
  EXPECT_DOUBLE_EQ(entry_of(entries, "replay", "all").metrics.at("jpe"), 3.0);
}

TEST(Leaderboard, DoesNotDependOnTheOrderOfRows) {
  std::vector<EpisodeRow> rows = small_benchmark();
  for (std::size_t i = 0; i < rows.size(); ++i) rows[i].metrics = {{"jpe", 0.1 * static_cast<double>(i) + 1e-9}};
  const nlohmann::json forward = analysis_json(leaderboard_analysis(leaderboard(rows)));
  std::reverse(rows.begin(), rows.end());
  EXPECT_EQ(analysis_json(leaderboard_analysis(leaderboard(rows))), forward);
}

TEST(Leaderboard, IsSortedWithTasksInTheirOrder) {
  std::vector<EpisodeRow> rows;
  for (const char* engine : {"ode", "mujoco"}) {
    for (const char* task : {"fly_kiss", "bend", "juggle", "hug", "high_five"}) {
      rows.push_back(episode("replay", task, 0, true));
      rows.back().engine = engine;
    }
  }
  std::vector<std::string> order;
  for (const LeaderboardEntry& entry : leaderboard(rows)) order.push_back(entry.engine + " " + entry.task);
  EXPECT_THAT(order, testing::ElementsAre("mujoco hug", "mujoco high_five", "mujoco bend", "mujoco fly_kiss",
                                          "mujoco juggle", "mujoco all", "ode hug", "ode high_five", "ode bend",
                                          "ode fly_kiss", "ode juggle", "ode all"));
}

TEST(Leaderboard, RefusesMixedSuitesAndEpisodesThatAreThereTwice) {
  std::vector<EpisodeRow> rows = {episode("replay", "hug", 0, true), episode("replay", "hug", 1, true)};
  rows[1].suite_version = "2.0.0";
  EXPECT_SENTENCE(thrown_message<InputError>([&] { leaderboard(rows); }));
  rows[1] = rows[0];
  EXPECT_SENTENCE(thrown_message<InputError>([&] { leaderboard(rows); }));
}

TEST(LeaderboardMarkdown, AlignsAndPrintsTheNullArmAsARow) {
  const std::string text = text_of(leaderboard(small_benchmark()));
  EXPECT_SENTENCE(text);
  EXPECT_THAT(text, HasSubstr("Hug (20)"));
  EXPECT_THAT(text, HasSubstr("| replay         |  30 | 83.3 [53.9, 95.5] |"));
  EXPECT_SENTENCE(text);
  std::size_t width = 0;
  std::istringstream lines(text);
  for (std::string line; std::getline(lines, line);) {
    if (!line.starts_with("|")) continue;
    if (width == 0) width = line.size();
    EXPECT_EQ(line.size(), width) << line;
    EXPECT_EQ(columns(line), 11U);
  }
}

TEST(LeaderboardMarkdown, MetricsOfSeveralEnginesAreATableEach) {
  std::vector<EpisodeRow> rows;
  for (const char* engine : {"ode", "mujoco"}) {
    rows.push_back(episode("replay", "hug", 0, true));
    rows.back().engine = engine;
    rows.back().metrics = {{"jpe", 0.125}};
  }
  const std::string text = text_of(leaderboard(rows));
  EXPECT_SENTENCE(text);
  EXPECT_THAT(terminal_text(leaderboard_analysis(leaderboard(rows))), Not(HasSubstr("Metric")));
  rows.pop_back();
  EXPECT_SENTENCE(terminal_text(leaderboard_analysis(leaderboard(rows))));
}

// A policy that does not play is no policy that scores 0.
std::vector<EpisodeRow> rows_of_a_dead_and_a_late_policy() {
  std::vector<EpisodeRow> rows = {episode("good", "hug", 0, true), episode("evil", "hug", 0, false),
                                  episode("evil", "hug", 1, false), episode("late", "hug", 0, false)};
  for (int i : {1, 2}) {
    rows[i].outcome = Outcome::kError;
    rows[i].policy_faults = {.late = 0, .invalid = i, .dead = true, .message = "policy 'evil': it ended"};
  }
  rows[3].policy_faults = {.late = 13, .invalid = 0, .dead = false, .message = "no plan for tick 0\x1b[31m"};
  return rows;
}

TEST(Leaderboard, PlansThatWereLostStandInEveryTable) {
  const std::vector<LeaderboardEntry> entries = leaderboard(rows_of_a_dead_and_a_late_policy());
  EXPECT_EQ(plans_lost(entry_of(entries, "evil", "all")), "3 invalid, dead in 2");
  EXPECT_EQ(plans_lost(entry_of(entries, "late", "all")), "13 late");
  EXPECT_EQ(plans_lost(entry_of(entries, "good", "all")), "0");
  const std::string text = text_of(entries);
  EXPECT_THAT(text, AllOf(HasSubstr("Plans lost |"), HasSubstr("3 invalid, dead in 2 |"), HasSubstr("13 late |")));
  EXPECT_SENTENCE(text);
  EXPECT_THAT(text, HasSubstr("The first fault: no plan for tick 0\\x1b[31m\n"));
  EXPECT_THAT(latex_of(entries), AllOf(HasSubstr("Plans lost"), HasSubstr("{\\footnotesize Policy 'late' lost plans")));
  const Analysis analysis = leaderboard_analysis(entries);
  const auto evil = [&](const char* name) {
    return estimate(analysis, {.policy = "evil", .task = "all", .name = name});
  };
  EXPECT_EQ(evil("policy_dead").value, 2.0);
  EXPECT_EQ(evil("plans_invalid").value, 3.0);
  EXPECT_SENTENCE(evil("policy_fault").text);
}

TEST(Leaderboard, WithoutAFaultThereIsNoColumnForPlans) {
  const std::vector<LeaderboardEntry> entries = leaderboard({episode("good", "hug", 0, true)});
  EXPECT_THAT(text_of(entries), Not(HasSubstr("lost")));
  EXPECT_THAT(latex_of(entries), Not(HasSubstr("lost")));
}

TEST(LeaderboardMarkdown, CaptionsAndNotesOfRowsAreEscapedToo) {
  EpisodeRow row = episode("p", "hug", 0, true);
  row.engine = "<script>x</script>\x1b[2J";
  const std::string text = text_of(leaderboard({row}));
  EXPECT_THAT(text, HasSubstr("Engine &lt;script>x&lt;/script>\\x1b[2J"));
  EXPECT_THAT(text, AllOf(Not(HasSubstr("<script")), Not(HasSubstr("\x1b"))));
  row.controller = "a\n\\end{document}";
  EXPECT_THAT(latex_of(leaderboard({row})), Not(HasSubstr("\n\\end{document}")));
}

TEST(LeaderboardMarkdown, EscapesNames) {
  std::vector<EpisodeRow> rows = {episode("a|b\n<c> <5", "hug", 0, true)};
  EXPECT_THAT(text_of(leaderboard(rows)), HasSubstr("a\\|b &lt;c> <5"));
  rows = {episode("a\x1b[31m\r", "hug", 0, true)};
  EXPECT_THAT(text_of(leaderboard(rows)), HasSubstr("| a\\x1b[31m"));
  EXPECT_EQ(text_of({}), "No episodes.\n");
}

TEST(LeaderboardMarkdown, NullArmComesAfterThePoliciesOfItsEngine) {
  std::vector<EpisodeRow> rows = {episode("zeta", "hug", 0, true), episode("null", "hug", 0, true, "null"),
                                  episode("clip", "hug", 0, true, "shuffled"), episode("alpha", "hug", 0, true)};
  const std::string text = text_of(leaderboard(rows));
  EXPECT_LT(text.find("| alpha"), text.find("| zeta"));
  EXPECT_LT(text.find("| zeta"), text.find("| clip (shuffled arm)"));
  EXPECT_LT(text.find("| clip (shuffled arm)"), text.find("| null (control)"));
}

TEST(LeaderboardFigures, AreOfEachTaskAndOfAll) {
  std::vector<EpisodeRow> rows = small_benchmark();
  rows[0].metrics = {{"jpe", 0.1}};
  const Analysis analysis = leaderboard_analysis(leaderboard(rows), {{"jpe", "Joint position error", "m", "lower"}});
  const Estimate success = estimate(analysis, {.engine = "mujoco",
                                               .controller = "vmc",
                                               .policy = "replay",
                                               .arm = "main",
                                               .perturbation = "clean",
                                               .task = "all",
                                               .name = "success"});
  EXPECT_EQ(success.n, 30);
  EXPECT_EQ(success.k, 25);
  EXPECT_DOUBLE_EQ(success.value, 25.0 / 30.0);
  EXPECT_LT(success.interval.low, wilson(25, 30).low);  // by clip
  EXPECT_EQ(estimate(analysis, {.policy = "replay", .task = "all", .name = "lift"}).n, 30);
  EXPECT_EQ(estimate(analysis, {.policy = "replay", .task = "all", .name = "jpe"}).unit, "m");
  EXPECT_TRUE(estimates_like(leaderboard_analysis(leaderboard(rows), {}, false), {.name = "jpe"}).empty());
}

TEST(LeaderboardFigures, EveryDetectorHasItsSuccess) {
  std::vector<EpisodeRow> rows = {episode("replay", "hug", 0, true)};
  Verdict& strict = rows[0].verdicts.emplace_back();
  strict.version = "paper";
  strict.thresholds = "strict";
  const Analysis analysis = leaderboard_analysis(leaderboard(rows));
  EXPECT_EQ(estimate(analysis, {.task = "all", .of = "paper/strict", .name = "success"}).value, 0.0);
}

TEST(LeaderboardLatex, IsABooktabsTabularWithEscapedNames) {
  EXPECT_THAT(latex_of(leaderboard({episode("d_star 100% & co", "high_five", 0, true)})),
              AllOf(HasSubstr("\\begin{tabular}{lrrrrrrrr}"),
                    HasSubstr("d\\_star 100\\% \\& co & 1 & 100.0 [20.7, 100.0] & -")));
}

TEST(LeaderboardFigures, ThereIsNoLiftWithoutANullArm) {
  const Analysis analysis = leaderboard_analysis(leaderboard({episode("replay", "hug", 0, true)}));
  for (const char* name : {"null_success", "lift"}) {
    const Estimate found = estimate(analysis, {.task = "all", .name = name});
    EXPECT_TRUE(std::isnan(found.value));
    EXPECT_TRUE(std::isnan(found.interval.low));
  }
}

}  // namespace
}  // namespace duet
