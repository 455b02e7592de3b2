#include "duet/report/ranking/comparison.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>

#include "duet/core/require.h"
#include "duet/report/ranking/policy_table.h"
#include "duet/report/studies/studies.h"
#include "duet/statistics/clustered.h"
#include "tests/report/estimates.h"
#include "tests/report/policy_rows.h"
#include "tests/rows/rows.h"
#include "tests/support.h"

namespace duet {
namespace {

using test::add_episodes;
using test::episode;
using test::estimate;
using test::thrown_message;
using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::Not;

// `policy` on hugs 0..n-1, of which those in [from, to) succeed.
std::vector<EpisodeRow> hugs(const std::string& policy, int n, int from, int to) {
  std::vector<EpisodeRow> rows;
  for (int i = 0; i < n; ++i) rows.push_back(episode(policy, "hug", i, i >= from && i < to));
  return rows;
}

// A name for each line of the table.
std::vector<std::string> groups(const Analysis& analysis) {
  std::vector<std::string> names;
  for (const std::vector<std::string>& cells : analysis.tables.at(0).table.rows) names.push_back(cells.front());
  return names;
}

Estimate of_hugs(const Analysis& analysis, const char* name, const char* perturbation = "clean") {
  return estimate(analysis, {.perturbation = perturbation, .task = "hug", .name = name});
}

TEST(CompareRuns, BuildsThePairedTableOfTwoPolicies) {
  const Analysis analysis = comparison_analysis(hugs("dstar", 40, 0, 30), hugs("replay", 40, 25, 38));
  EXPECT_THAT(groups(analysis), ElementsAre("mujoco/vmc/dstar vs replay hug", "mujoco/vmc/dstar vs replay all"));
  const auto value = [&](const char* name) { return of_hugs(analysis, name).value; };
  EXPECT_EQ(of_hugs(analysis, "difference").n, 40);
  EXPECT_EQ(value("both"), 5.0);
  EXPECT_EQ(value("only_a"), 25.0);
  EXPECT_EQ(value("only_b"), 8.0);
  EXPECT_EQ(value("neither"), 2.0);
  EXPECT_DOUBLE_EQ(value("difference"), 17.0 / 40.0);
  EXPECT_EQ(of_hugs(analysis, "difference").interval.low, newcombe_paired(5, 25, 8, 2).low);
  EXPECT_EQ(value("clips"), 14.0);  // three draws of each
  EXPECT_EQ(value("p_episodes"), mcnemar_exact(25, 8));
  // Sums of successes of A less those of B: clips 0 to 7 go A's way whole, in the ninth one draw, then B's.
  EXPECT_EQ(value("p"), sign_flip_exact(std::vector<long>{3, 3, 3, 3, 3, 3, 3, 3, 1, 0, -3, -3, -2, 0}));
  EXPECT_GT(value("p"), value("p_episodes"));
  EXPECT_EQ(value("p_holm"), std::min(1.0, 2.0 * value("p")));
  EXPECT_EQ(value("minimum_detectable"), minimum_detectable_difference_paired(33.0 / 40.0, 40));
  const Estimate by_clip = of_hugs(analysis, "difference_by_clip");
  EXPECT_LT(by_clip.interval.low, by_clip.value);
  EXPECT_GT(by_clip.interval.high, by_clip.value);
}

// Where the two roles of a clip go the same way, twice as many episodes say no more than one role of each.
TEST(CompareRuns, ClustersTheTwoRolesOfAClipTogether) {
  const auto compared = [](bool other_role) {
    std::vector<EpisodeRow> a = hugs("dstar", 20, 0, 15), b = hugs("replay", 20, 10, 20);
    for (std::vector<EpisodeRow>* rows : {&a, &b}) {
      for (EpisodeRow row : std::vector<EpisodeRow>(*rows)) {
        if (other_role) test::set_tag(row, kRecordingTag, row.clip);
        row.clip += "-again";
        rows->push_back(row);
      }
    }
    return of_hugs(comparison_analysis(a, b), "difference_by_clip");
  };
  const auto width = [](const Estimate& of) { return of.interval.high - of.interval.low; };
  const Estimate roles = compared(true), takes = compared(false);
  EXPECT_EQ(roles.n, 40);
  EXPECT_EQ(roles.value, takes.value);
  EXPECT_GT(width(roles), 1.25 * width(takes));  // the square root of two, but for chance
}

TEST(CompareRuns, PairsByEpisodeAndNotByOrder) {
  std::vector<EpisodeRow> a = hugs("replay", 12, 0, 6);
  std::vector<EpisodeRow> b = hugs("replay", 12, 0, 6);
  std::reverse(b.begin(), b.end());
  const Analysis same = comparison_analysis(a, b);
  EXPECT_EQ(groups(same).front(), "mujoco/vmc/replay hug");
  EXPECT_EQ(of_hugs(same, "only_a").value + of_hugs(same, "only_b").value, 0.0);
  EXPECT_EQ(of_hugs(same, "p").value, 1.0);
  EXPECT_GT(of_hugs(same, "minimum_detectable").value, 0.3);
}

TEST(CompareRuns, SharedFieldsMustAgreeAndTheRestIsLeftOut) {
  std::vector<EpisodeRow> a = hugs("replay", 10, 0, 5);
  for (const EpisodeRow& row : hugs("dstar", 10, 0, 5)) a.push_back(row);
  std::vector<EpisodeRow> b = hugs("replay", 8, 0, 8);
  const Analysis analysis = comparison_analysis(a, b);
  EXPECT_THAT(groups(analysis), ElementsAre("mujoco/vmc/replay hug", "mujoco/vmc/replay all"));
  EXPECT_EQ(of_hugs(analysis, "difference").n, 8);
  EXPECT_EQ(of_hugs(analysis, "unpaired_a").value, 2.0);
  EXPECT_EQ(of_hugs(analysis, "unpaired_b").value, 0.0);
  EXPECT_SENTENCE(analysis_markdown(analysis));
}

TEST(CompareRuns, PerturbationsAreNamedAndKeptApart) {
  std::vector<EpisodeRow> a = hugs("replay", 6, 0, 6);
  std::vector<EpisodeRow> b = hugs("replay", 6, 0, 3);
  for (EpisodeRow row : hugs("replay", 6, 0, 2)) {
    row.perturbation = "jitter_0.05";
    a.push_back(row);
    b.push_back(row);
  }
  const Analysis analysis = comparison_analysis(a, b);
  EXPECT_THAT(groups(analysis), ElementsAre("mujoco/vmc/replay hug", "mujoco/vmc/replay all",
                                            "mujoco/vmc/replay jitter_0.05 hug", "mujoco/vmc/replay jitter_0.05 all"));
  EXPECT_EQ(of_hugs(analysis, "only_a", "jitter_0.05").value, 0.0);
  EXPECT_EQ(of_hugs(analysis, "only_a").value, 3.0);
}

TEST(CompareRuns, OnlyTheMainArmIsCompared) {
  std::vector<EpisodeRow> a = hugs("replay", 6, 0, 6);
  std::vector<EpisodeRow> b = hugs("replay", 6, 0, 3);
  for (int i = 0; i < 6; ++i) {
    a.push_back(episode("null", "hug", i, true, "null"));
    b.push_back(episode("null", "hug", i, false, "null"));
  }
  EXPECT_EQ(groups(comparison_analysis(a, b)).size(), 2U);
}

TEST(CompareRuns, IsReproducible) {
  const auto compared = [] { return comparison_analysis(hugs("a", 30, 0, 20), hugs("b", 30, 5, 15)); };
  EXPECT_EQ(analysis_json(compared()), analysis_json(compared()));
}

TEST(CompareRuns, FiguresSayWhatIsComparedWithWhat) {
  const Analysis analysis = comparison_analysis(hugs("a", 30, 0, 20), hugs("b", 30, 5, 15), {}, 0.1);
  const Estimate of_all{
      .engine = "mujoco", .controller = "vmc", .policy = "a vs b", .perturbation = "clean", .task = "all"};
  const auto named = [&](const char* name) {
    Estimate like = of_all;
    like.name = name;
    return estimate(analysis, like);
  };
  EXPECT_EQ(named("success_a").k, 20);
  EXPECT_EQ(named("success_b").k, 10);
  EXPECT_EQ(named("difference").n, 30);
  EXPECT_DOUBLE_EQ(named("difference").value, 1.0 / 3.0);
  EXPECT_EQ(named("only_b").value, 0.0);
  EXPECT_LE(named("p_holm").value, 1.0);
  EXPECT_EQ(named("verdict").text, "undecided");  // ten episodes, but of four clips
  EXPECT_EQ(estimate(analysis, {.name = "margin"}).value, 0.1);
}

TEST(CompareRuns, SaysWhatDiffersWhereNothingPairs) {
  const std::vector<EpisodeRow> a = hugs("replay", 4, 0, 2);
  const auto refusal = [&](const std::vector<EpisodeRow>& b) {
    return thrown_message<InputError>([&] { comparison_analysis(a, b); });
  };
  EXPECT_SENTENCE(refusal({}));
  EXPECT_SENTENCE(refusal({episode("replay", "wave", 0, true)}));
  std::vector<EpisodeRow> b = a;
  for (EpisodeRow& row : b) row.clip = "another";
  EXPECT_SENTENCE(refusal(b));
  b = a;
  for (EpisodeRow& row : b) row.episode += 100;
  EXPECT_SENTENCE(refusal(b));
  b = a;
  for (EpisodeRow& row : b) row.suite_version = "1.1.0";
  EXPECT_SENTENCE(refusal(b));
  b = a;
  for (EpisodeRow& row : b) row.arm = "null";
  EXPECT_SENTENCE(refusal(b));
  b = a;
  b[0].engine = "ode";
  b[1].engine = "dart";
  b.resize(2);
  EXPECT_SENTENCE(refusal(b));
  b = {a[3]};
  b[0].clip = "hug-0";
  EXPECT_SENTENCE(refusal(b));
}

TEST(CompareRuns, RefusesAnEpisodeThatIsThereTwice) {
  std::vector<EpisodeRow> a = hugs("replay", 4, 0, 2);
  a.push_back(a.front());
  EXPECT_SENTENCE(thrown_message<InputError>([&] { comparison_analysis(a, hugs("replay", 4, 0, 2)); }));
}

TEST(ComparisonMarkdown, WarnsOfSmallSamples) {
  const std::string small = analysis_markdown(comparison_analysis(hugs("a", 10, 0, 9), hugs("b", 10, 0, 3)));
  EXPECT_SENTENCE(small);
  EXPECT_THAT(small, HasSubstr("+60.0 ["));
  const std::string large = analysis_markdown(comparison_analysis(hugs("a", 120, 0, 100), hugs("b", 120, 0, 40)));
  EXPECT_THAT(large,
              AllOf(Not(HasSubstr("Warning")), HasSubstr("<0.001"), HasSubstr("corrected for the 2 comparisons")));
}

TEST(Resolution, VerdictOfAFixedNumberOfPairs) {
  const auto verdict = [](long both, long only_a, long only_b, double p_holm, double margin) {
    const auto pairs = static_cast<double>(both + only_a + only_b);
    return verdict_of(static_cast<double>(only_a - only_b) / pairs, newcombe_paired(both, only_a, only_b, 0), p_holm,
                      0.95, margin);
  };
  EXPECT_EQ(verdict(80, 20, 0, 0.05, 0.05), SequentialDecision::kBetter);
  EXPECT_EQ(verdict(80, 0, 20, 0.01, 0.05), SequentialDecision::kWorse);
  EXPECT_EQ(verdict(80, 20, 0, 0.06, 0.05), SequentialDecision::kUndecided);
  EXPECT_EQ(verdict(2000, 5, 4, 1.0, 0.05), SequentialDecision::kSame);
  EXPECT_EQ(verdict(2000, 30, 0, 0.001, 0.05), SequentialDecision::kSame);  // not zero, and too small to matter
  EXPECT_EQ(verdict(2000, 30, 0, 0.001, 0.01), SequentialDecision::kBetter);
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
  EXPECT_SENTENCE(thrown_message<std::invalid_argument>([] { needed_pairs(0.1, 0.0); }));
}

// `both` clips that A and B pass, then those that A alone and B alone does, one episode each.
Analysis compared(int both, int only_a, int only_b, double margin = kFivePoints) {
  std::vector<EpisodeRow> a = hugs("a", both + only_a + only_b, 0, both + only_a);
  std::vector<EpisodeRow> b = hugs("b", both + only_a + only_b, 0, both);
  for (int i = both + only_a; i < both + only_a + only_b; ++i) b[static_cast<std::size_t>(i)].success = true;
  for (std::vector<EpisodeRow>* rows : {&a, &b})
    for (EpisodeRow& row : *rows) row.clip = "hug-" + std::to_string(row.episode);
  return comparison_analysis(a, b, {.resamples = 200}, margin);
}

TEST(Resolution, ACautionNamesThePairsThatAreNeeded) {
  const Analysis small = compared(100, 12, 14);
  const std::vector<std::string> cautions = resolution_notes(small.estimates, small.level, 0.05);
  ASSERT_EQ(cautions.size(), 2U);  // hugs and all
  EXPECT_SENTENCE(cautions[0]);
  EXPECT_TRUE(resolution_notes(small.estimates, small.level, 0.5).empty());
  const Analysis decided = compared(80, 20, 0);
  EXPECT_TRUE(resolution_notes(decided.estimates, decided.level, 0.05).empty());
  EXPECT_THAT(analysis_markdown(small), AllOf(HasSubstr("Caution: "), HasSubstr("| undecided")));
  const Analysis wide = compared(100, 12, 14, 0.5);
  EXPECT_THAT(analysis_markdown(wide), AllOf(Not(HasSubstr("Caution: ")), HasSubstr("| same within the margin")));
  EXPECT_EQ(of_hugs(small, "verdict").text, "undecided");
  EXPECT_EQ(estimate(wide, {.name = "margin"}).value, 0.5);
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
  EXPECT_SENTENCE(resolution_notes(std::vector<LeaderboardEntry>{arm}, 0.05).at(0));
  arm.n = 801;
  EXPECT_TRUE(resolution_notes(std::vector<LeaderboardEntry>{arm}, 0.05).empty());
  arm.n = 10;
  arm.task = "hug";
  EXPECT_TRUE(resolution_notes(std::vector<LeaderboardEntry>{arm}, 0.05).empty());
}

// Every table says of which level its intervals are.

// Two policies under two controllers in two engines, clean and perturbed, with the null arm beside them.
std::vector<EpisodeRow> rows() {
  std::vector<EpisodeRow> all;
  for (const char* engine : {"mujoco", "ode"})
    for (const char* controller : {"vmc", "pd"})
      for (const char* perturbation : {"clean", "jitter_1cm", "jitter_5cm"}) {
        for (const char* policy : {"dstar", "replay"})
          add_episodes({.engine = engine,
                        .controller = controller,
                        .policy = policy,
                        .perturbation = perturbation,
                        .successes = policy[0] == 'd' ? "1101" : "1001"},
                       all);
        add_episodes({.engine = engine,
                      .controller = controller,
                      .policy = "null",
                      .perturbation = perturbation,
                      .arm = "null",
                      .successes = "0001"},
                     all);
      }
  for (EpisodeRow& row : all)
    row.metrics = {
        {"hf_ratio", 0.25},    {"hf_ratio_reference", 0.125}, {"dof_jerk", 800.0},  {"dof_jerk_reference", 200.0},
        {"root_jerk", 50.0},   {"root_jerk_reference", 25.0}, {"root_error", 0.25}, {"root_angle_error", 7.5},
        {"dof_error", 0.0625}, {"dof_velocity_error", 0.5}};
  return all;
}

TEST(Notes, EveryTableNamesTheLevelOfItsIntervals) {
  const std::vector<EpisodeRow> all = rows();
  for (const Analysis& analysis : {leaderboard_analysis(leaderboard(all)), controller_analysis(all),
                                   policy_analysis(all, leaderboard(all)), degradation_analysis(all)}) {
    const std::string text = analysis_markdown(analysis);
    EXPECT_THAT(text, HasSubstr("95 %"));
    EXPECT_THAT(text, ::testing::Not(HasSubstr("195 %"))) << text;
  }
}

TEST(Notes, AComparisonNamesTheLevelOfItsIntervals) {
  std::vector<EpisodeRow> a, b;
  add_episodes({.policy = "dstar", .successes = "110111011101"}, a);
  add_episodes({.policy = "replay", .successes = "100110001101"}, b);
  const std::string text = analysis_markdown(comparison_analysis(a, b));
  EXPECT_THAT(text, HasSubstr("95 %"));
  EXPECT_THAT(text, ::testing::Not(HasSubstr("195 %")));
}

}  // namespace
}  // namespace duet
