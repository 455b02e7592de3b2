#include <gmock/gmock.h>

#include <algorithm>

#include "duet/core/require.h"
#include "duet/report/ranking/resolution.h"
#include "duet/statistics/by_clip.h"
#include "tests/report/figures.h"
#include "tests/rows/rows.h"
#include "tests/support.h"

namespace duet {
namespace {

using test::episode;
using test::figure;
using test::thrown_message;
using testing::AllOf;
using testing::HasSubstr;
using testing::Not;

// `policy` on hugs 0..n-1, of which those in [from, to) succeed.
std::vector<EpisodeRow> hugs(const std::string& policy, int n, int from, int to) {
  std::vector<EpisodeRow> rows;
  for (int i = 0; i < n; ++i) rows.push_back(episode(policy, "hug", i, i >= from && i < to));
  return rows;
}

TEST(CompareRuns, BuildsThePairedTableOfTwoPolicies) {
  const std::vector<Comparison> comparisons = compare_runs(hugs("dstar", 40, 0, 30), hugs("replay", 40, 25, 38));
  ASSERT_EQ(comparisons.size(), 2U);
  const Comparison& hug = comparisons[0];
  EXPECT_EQ(hug.group, "mujoco/vmc/dstar vs replay hug");
  EXPECT_EQ(comparisons[1].group, "mujoco/vmc/dstar vs replay all");
  EXPECT_EQ(hug.pairs, 40);
  EXPECT_EQ(hug.both, 5);
  EXPECT_EQ(hug.only_a, 25);
  EXPECT_EQ(hug.only_b, 8);
  EXPECT_EQ(hug.neither, 2);
  EXPECT_DOUBLE_EQ(hug.difference, 17.0 / 40.0);
  EXPECT_EQ(hug.interval.low, newcombe_paired(5, 25, 8, 2).low);
  EXPECT_EQ(hug.clips, 14);  // three draws of each
  EXPECT_EQ(hug.p_episodes, mcnemar_exact(25, 8));
  // Sums of successes of A less those of B: clips 0 to 7 go A's way whole, in the ninth one draw, then B's.
  EXPECT_EQ(hug.p, sign_flip_exact(std::vector<long>{3, 3, 3, 3, 3, 3, 3, 3, 1, 0, -3, -3, -2, 0}));
  EXPECT_GT(hug.p, hug.p_episodes);
  EXPECT_EQ(hug.p_holm, std::min(1.0, 2.0 * hug.p));
  EXPECT_EQ(hug.minimum_detectable, minimum_detectable_difference_paired(33.0 / 40.0, 40));
  EXPECT_LT(hug.cluster_interval.low, hug.difference);
  EXPECT_GT(hug.cluster_interval.high, hug.difference);
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
    return compare_runs(a, b)[0];
  };
  const auto width = [](const Comparison& of) { return of.cluster_interval.high - of.cluster_interval.low; };
  const Comparison roles = compared(true), takes = compared(false);
  EXPECT_EQ(roles.pairs, 40);
  EXPECT_EQ(roles.difference, takes.difference);
  EXPECT_GT(width(roles), 1.25 * width(takes));  // the square root of two, but for chance
}

TEST(CompareRuns, PairsByEpisodeAndNotByOrder) {
  std::vector<EpisodeRow> a = hugs("replay", 12, 0, 6);
  std::vector<EpisodeRow> b = hugs("replay", 12, 0, 6);
  std::reverse(b.begin(), b.end());
  const Comparison same = compare_runs(a, b)[0];
  EXPECT_EQ(same.group, "mujoco/vmc/replay hug");
  EXPECT_EQ(same.only_a + same.only_b, 0);
  EXPECT_EQ(same.p, 1.0);
  EXPECT_GT(same.minimum_detectable, 0.3);
}

TEST(CompareRuns, SharedFieldsMustAgreeAndTheRestIsLeftOut) {
  std::vector<EpisodeRow> a = hugs("replay", 10, 0, 5);
  for (const EpisodeRow& row : hugs("dstar", 10, 0, 5)) a.push_back(row);
  std::vector<EpisodeRow> b = hugs("replay", 8, 0, 8);
  const std::vector<Comparison> comparisons = compare_runs(a, b);
  ASSERT_EQ(comparisons.size(), 2U);
  EXPECT_EQ(comparisons[0].group, "mujoco/vmc/replay hug");
  EXPECT_EQ(comparisons[0].pairs, 8);
  EXPECT_EQ(comparisons[0].unpaired_a, 2);
  EXPECT_EQ(comparisons[0].unpaired_b, 0);
  EXPECT_THAT(analysis_markdown(comparison_analysis(comparisons)), HasSubstr("up to 2 of A and 0 of B"));
}

TEST(CompareRuns, PerturbationsAreNamedAndKeptApart) {
  std::vector<EpisodeRow> a = hugs("replay", 6, 0, 6);
  std::vector<EpisodeRow> b = hugs("replay", 6, 0, 3);
  for (EpisodeRow row : hugs("replay", 6, 0, 2)) {
    row.perturbation = "jitter_0.05";
    a.push_back(row);
    b.push_back(row);
  }
  const std::vector<Comparison> comparisons = compare_runs(a, b);
  ASSERT_EQ(comparisons.size(), 4U);
  EXPECT_EQ(comparisons[2].group, "mujoco/vmc/replay jitter_0.05 hug");
  EXPECT_EQ(comparisons[2].only_a, 0);
  EXPECT_EQ(comparisons[0].only_a, 3);
}

TEST(CompareRuns, OnlyTheMainArmIsCompared) {
  std::vector<EpisodeRow> a = hugs("replay", 6, 0, 6);
  std::vector<EpisodeRow> b = hugs("replay", 6, 0, 3);
  for (int i = 0; i < 6; ++i) {
    a.push_back(episode("null", "hug", i, true, "null"));
    b.push_back(episode("null", "hug", i, false, "null"));
  }
  EXPECT_EQ(compare_runs(a, b).size(), 2U);
}

TEST(CompareRuns, IsReproducible) {
  const auto compared = [] { return comparison_analysis(compare_runs(hugs("a", 30, 0, 20), hugs("b", 30, 5, 15))); };
  EXPECT_EQ(analysis_json(compared()), analysis_json(compared()));
}

TEST(CompareRuns, FiguresSayWhatIsComparedWithWhat) {
  const Analysis analysis = comparison_analysis(compare_runs(hugs("a", 30, 0, 20), hugs("b", 30, 5, 15)), 0.1);
  const Figure of_all{
      .engine = "mujoco", .controller = "vmc", .policy = "a vs b", .perturbation = "clean", .task = "all"};
  const auto named = [&](const char* name) {
    Figure like = of_all;
    like.name = name;
    return figure(analysis, like);
  };
  EXPECT_EQ(named("success_a").k, 20);
  EXPECT_EQ(named("success_b").k, 10);
  EXPECT_EQ(named("difference").n, 30);
  EXPECT_DOUBLE_EQ(named("difference").value, 1.0 / 3.0);
  EXPECT_EQ(named("only_b").value, 0.0);
  EXPECT_LE(named("p_holm").value, 1.0);
  EXPECT_EQ(named("verdict").text, "undecided");  // ten episodes, but of four clips
  EXPECT_EQ(figure(analysis, {.name = "margin"}).value, 0.1);
}

TEST(CompareRuns, SaysWhatDiffersWhereNothingPairs) {
  const std::vector<EpisodeRow> a = hugs("replay", 4, 0, 2);
  const auto refusal = [&](const std::vector<EpisodeRow>& b) {
    return thrown_message<InputError>([&] { compare_runs(a, b); });
  };
  EXPECT_THAT(refusal({}), HasSubstr("run B has no episodes"));
  EXPECT_THAT(refusal({episode("replay", "wave", 0, true)}), HasSubstr("the tasks of A are hug, those of B wave"));
  std::vector<EpisodeRow> b = a;
  for (EpisodeRow& row : b) row.clip = "another";
  EXPECT_THAT(refusal(b), HasSubstr("the clips of A are hug-0, hug-1, those of B another"));
  b = a;
  for (EpisodeRow& row : b) row.episode += 100;
  EXPECT_THAT(refusal(b), AllOf(HasSubstr("the episodes of A are 0, 1, 2, 3"), HasSubstr("those of B 100")));
  b = a;
  for (EpisodeRow& row : b) row.suite_version = "1.1.0";
  EXPECT_THAT(refusal(b), HasSubstr("A is of suite tiny@1.0.0, B of tiny@1.1.0"));
  b = a;
  for (EpisodeRow& row : b) row.arm = "null";
  EXPECT_THAT(refusal(b), HasSubstr("run B has no episodes of the main arm"));
  b = a;
  b[0].engine = "ode";
  b[1].engine = "dart";
  b.resize(2);
  EXPECT_THAT(refusal(b), HasSubstr("the engine of A is mujoco, that of B dart, ode"));
  b = {a[3]};
  b[0].clip = "hug-0";
  EXPECT_THAT(refusal(b), HasSubstr("but no combination of them"));
}

TEST(CompareRuns, RefusesAnEpisodeThatIsThereTwice) {
  std::vector<EpisodeRow> a = hugs("replay", 4, 0, 2);
  a.push_back(a.front());
  EXPECT_THAT(thrown_message<InputError>([&] { compare_runs(a, hugs("replay", 4, 0, 2)); }),
              HasSubstr("is there twice"));
}

TEST(ComparisonMarkdown, WarnsOfSmallSamples) {
  const std::string small =
      analysis_markdown(comparison_analysis(compare_runs(hugs("a", 10, 0, 9), hugs("b", 10, 0, 3))));
  EXPECT_THAT(small, HasSubstr("Warning: fewer than 30 clips in mujoco/vmc/a vs b hug"));
  EXPECT_THAT(small, HasSubstr("+60.0 ["));
  const std::string large =
      analysis_markdown(comparison_analysis(compare_runs(hugs("a", 120, 0, 100), hugs("b", 120, 0, 40))));
  EXPECT_THAT(large,
              AllOf(Not(HasSubstr("Warning")), HasSubstr("<0.001"), HasSubstr("corrected for the 2 comparisons")));
  EXPECT_EQ(analysis_markdown(comparison_analysis({})), "Nothing to compare.\n");
}

}  // namespace
}  // namespace duet
