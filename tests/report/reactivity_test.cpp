#include <gmock/gmock.h>

#include <cmath>

#include "duet/core/require.h"
#include "duet/report/studies/studies.h"
#include "tests/report/estimates.h"
#include "tests/report/policy_rows.h"
#include "tests/support.h"

namespace duet {
namespace {

using test::add_episodes;
using test::estimate;
using test::thrown_message;
using testing::AllOf;
using testing::HasSubstr;
using testing::Not;

// Six episodes of two clips; clean the partner's onset is at 2 s + number and the robot's 0.5 s later. A perturbation
// moves the partner's by `shift`, the robot's by `follows` of it.
void add_shifted(const std::string& policy, const std::string& perturbation, double shift, double follows,
                 std::vector<EpisodeRow>& rows) {
  const std::size_t first = rows.size();
  add_episodes({.policy = policy, .perturbation = perturbation, .successes = "111111"}, rows);
  for (std::size_t i = first; i < rows.size(); ++i) {
    const double onset = 2.0 + rows[i].episode;
    rows[i].metrics["partner_onset_s"] = onset + shift;
    rows[i].metrics["onset_s"] = onset + 0.5 + follows * shift;
  }
}

std::vector<EpisodeRow> shifted(const std::string& policy, double follows) {
  std::vector<EpisodeRow> rows;
  add_shifted(policy, "clean", 0.0, follows, rows);
  add_shifted(policy, "later_1.0", 1.0, follows, rows);
  add_shifted(policy, "earlier_0.5", -0.5, follows, rows);
  add_shifted(policy, "jitter_1cm", 0.0, follows, rows);
  return rows;
}

// An onset more than 0.3 s before the partner's; the rule's own verdict, which counts withdrawn ones, comes first.
TEST(Reactivity, FalseStartsAreCounted) {
  std::vector<EpisodeRow> rows = shifted("dstar", 1.0);
  const auto false_starts = [&] { return estimate(reactivity_analysis(rows), {.name = "false_starts"}); };
  EXPECT_EQ(false_starts().value, 0.0);
  EXPECT_EQ(false_starts().n, 24);
  rows[0].metrics["onset_s"] = rows[0].metrics.at("partner_onset_s") - 0.31;
  rows[1].metrics["onset_s"] = rows[1].metrics.at("partner_onset_s") - 0.29;
  for (const int i : {2, 3}) rows[i].verdicts.emplace_back().version = "interaction";
  rows[2].verdicts.back().values = {{"lead_s", 0.4}};  // the other never begins
  EXPECT_EQ(false_starts().value, 2.0);
  EXPECT_EQ(false_starts().n, 23);
  EXPECT_THAT(analysis_markdown(reactivity_analysis(rows)), HasSubstr("2/23"));
}

std::string text_of(const std::vector<EpisodeRow>& rows) { return analysis_markdown(reactivity_analysis(rows)); }

TEST(Reactivity, AFollowerHasSlopeOneAndAReplayNone) {
  std::vector<EpisodeRow> rows = shifted("dstar", 1.0);
  const std::vector<EpisodeRow> replay = shifted("replay", 0.0);
  rows.insert(rows.end(), replay.begin(), replay.end());
  const Analysis analysis = reactivity_analysis(rows);
  const auto of = [&](const char* policy, const char* name) {
    return estimate(analysis, {.policy = policy, .name = name});
  };
  EXPECT_EQ(of("dstar", "slope").n, 12);  // jitter moves nobody
  EXPECT_NEAR(of("dstar", "slope").value, 1.0, 1e-12);
  EXPECT_NEAR(of("dstar", "slope").interval.low, 1.0, 1e-12);
  EXPECT_NEAR(of("dstar", "delay_clean").value, 0.5, 1e-12);
  EXPECT_EQ(of("dstar", "delay_clean").n, 6);
  EXPECT_NEAR(of("dstar", "delay_moved").value, 0.5, 1e-12);
  EXPECT_NEAR(of("replay", "slope").value, 0.0, 1e-12);
  EXPECT_NEAR(of("replay", "delay_moved").value, 0.25, 1e-12);  // half of them -0.5, half of them 1.0
}

TEST(Reactivity, SlopeIsLeastSquaresThroughTheOrigin) {
  std::vector<EpisodeRow> rows;
  add_shifted("dstar", "clean", 0.0, 0.0, rows);
  add_shifted("dstar", "later_1.0", 1.0, 1.0, rows);
  add_shifted("dstar", "later_2.0", 2.0, 0.5, rows);
  const Analysis analysis = reactivity_analysis(rows);
  EXPECT_NEAR(estimate(analysis, {.name = "slope"}).value, (1.0 * 1.0 + 2.0 * 1.0) / (1.0 + 4.0), 1e-12);
  EXPECT_NEAR(estimate(analysis, {.perturbation = "later_2.0", .name = "partner_shift"}).value, 2.0, 1e-12);
  EXPECT_NEAR(estimate(analysis, {.perturbation = "later_2.0", .name = "robot_shift"}).value, 1.0, 1e-12);
}

TEST(Reactivity, MedianSlopeIsThatOfMostEpisodes) {
  std::vector<EpisodeRow> rows = shifted("dstar", 1.0);
  rows.at(6).metrics["onset_s"] = 0.0;  // an arm that swung, of one episode of later_1.0
  const Analysis analysis = reactivity_analysis(rows);
  EXPECT_LT(estimate(analysis, {.name = "slope"}).value, 0.9);
  EXPECT_NEAR(estimate(analysis, {.name = "median_slope"}).value, 1.0, 1e-12);
  EXPECT_NEAR(estimate(analysis, {.name = "median_slope"}).interval.high, 1.0, 1e-12);
}

TEST(Reactivity, EachOfSeveralTasksHasItsLine) {
  std::vector<EpisodeRow> rows = shifted("dstar", 1.0);
  std::vector<EpisodeRow> waves = shifted("dstar", 0.5);
  for (EpisodeRow& row : waves) row.task = "wave";
  rows.insert(rows.end(), waves.begin(), waves.end());
  const Analysis analysis = reactivity_analysis(rows);
  EXPECT_THAT(values_of(analysis.estimates, &Estimate::task), testing::ElementsAre("all", "hug", "wave"));
  const auto slope = [&](const char* task) { return estimate(analysis, {.task = task, .name = "slope"}); };
  EXPECT_EQ(slope("all").n, 24);
  EXPECT_NEAR(slope("hug").value, 1.0, 1e-12);
  EXPECT_NEAR(slope("wave").value, 0.5, 1e-12);
  EXPECT_EQ(analysis.plots.at(0).plots.at(0).series.size(), 1U);
}

TEST(Reactivity, OneClipHasNoInterval) {
  std::vector<EpisodeRow> rows = shifted("dstar", 1.0);
  std::erase_if(rows, [](const EpisodeRow& row) { return row.clip != "hug-0"; });
  EXPECT_TRUE(std::isnan(estimate(reactivity_analysis(rows), {.name = "slope"}).interval.low));
  EXPECT_THAT(text_of(rows), HasSubstr(" 1.00 |"));
}

TEST(Reactivity, RobotsThatDidNotActAreCountedAndInNoSlope) {
  std::vector<EpisodeRow> rows = shifted("dstar", 1.0);
  for (EpisodeRow& row : rows)
    if (row.perturbation == "later_1.0") row.metrics.erase("onset_s");
  EXPECT_EQ(estimate(reactivity_analysis(rows), {.name = "slope"}).n, 6);
  EXPECT_EQ(estimate(reactivity_analysis(rows), {.name = "did_not_act"}).value, 6.0);
  for (EpisodeRow& row : rows) row.metrics.erase("onset_s");
  const Analysis none = reactivity_analysis(rows);
  EXPECT_EQ(estimate(none, {.name = "did_not_act"}).value, 12.0);
  EXPECT_TRUE(std::isnan(estimate(none, {.name = "slope"}).value));
  EXPECT_THAT(text_of(rows), HasSubstr(" 12 |"));
  EXPECT_TRUE(none.plots.at(0).plots.empty());
}

TEST(Reactivity, WithoutAMovedPartnerOrVariantsThereIsNothing) {
  std::vector<EpisodeRow> rows = shifted("dstar", 1.0);
  std::erase_if(rows, [](const EpisodeRow& row) { return row.perturbation == "clean"; });
  EXPECT_SENTENCE(text_of(rows));
  EXPECT_TRUE(reactivity_analysis(rows).empty());
}

void offer(const std::string& side, const std::string& height, EpisodeRow& row) {
  test::set_tag(row, kSideTag, side);
  test::set_tag(row, kHeightTag, height);
}

TEST(Reactivity, VariantsOfOneHeightOrOfThreeAreNoTable) {
  std::vector<EpisodeRow> rows;
  add_episodes({.task = "handshake", .successes = "110"}, rows);
  for (EpisodeRow& row : rows) row.clip = "handshake-0-left_high";
  EXPECT_TRUE(reactivity_analysis(rows).empty());  // names say nothing
  for (EpisodeRow& row : rows) offer("left", "0.9", row);
  EXPECT_TRUE(reactivity_analysis(rows).empty());
  offer("left", "1", rows[0]);
  EXPECT_EQ(reactivity_analysis(rows).tables.size(), 1U);
  offer("left", "1.15", rows[1]);
  EXPECT_TRUE(reactivity_analysis(rows).empty());
}

TEST(Reactivity, CellsAreSuccessByVariantBesideThePapers) {
  std::vector<EpisodeRow> rows;
  add_episodes({.task = "handshake", .successes = "1101"}, rows);
  for (EpisodeRow& row : rows) {
    row.clip = "handshake-0-right_low";
    offer("left", "1.15", row);
  }
  add_episodes({.task = "handshake", .successes = "0100"}, rows);
  for (std::size_t i = 4; i < 8; ++i) {
    rows[i].clip = "handshake-0-left_high";
    offer("right", "0.9", rows[i]);
  }
  const Analysis analysis = reactivity_analysis(rows);
  const std::vector<TitledTable>& tables = analysis.tables;
  ASSERT_EQ(tables.size(), 1U);
  EXPECT_EQ(tables[0].table.rows.at(1),
            (std::vector<std::string>{"D-STAR (the paper's)", "Handshake", "80.0", "100.0", "40.0", "60.0"}));
  EXPECT_THAT(text_of(rows), AllOf(HasSubstr("75.0 ["), HasSubstr("0.9 m is low, 1.15 m high"), HasSubstr("real robot"),
                                   Not(HasSubstr("Slope"))));
  const auto cell = [&](const char* variant) {
    return estimate(analysis, {.policy = "dstar", .task = "handshake", .of = variant, .name = "success"});
  };
  EXPECT_EQ(cell("left_high").k, 3);
  EXPECT_EQ(cell("right_low").k, 1);
  EXPECT_EQ(cell("right_high").n, 0);
  EXPECT_EQ(estimate(analysis, {.source = "paper", .task = "handshake", .of = "left_low", .name = "success"}).value,
            0.4);
}

TEST(Reactivity, PlotShowsTheShiftsOfEveryPolicy) {
  const Analysis analysis = reactivity_analysis(shifted("dstar", 1.0));
  const std::vector<LinePlot>& plots = analysis.plots.at(0).plots;
  ASSERT_EQ(plots.size(), 1U);
  ASSERT_EQ(plots[0].series.size(), 1U);
  EXPECT_THAT(plots[0].series[0].x,
              testing::ElementsAre(testing::DoubleNear(-0.5, 1e-12), testing::DoubleNear(1.0, 1e-12)));
}

TEST(Reactivity, FiguresAreOfPoliciesAndOfPerturbations) {
  const Analysis analysis = reactivity_analysis(shifted("dstar", 1.0));
  EXPECT_NEAR(estimate(analysis, {.policy = "dstar", .name = "slope"}).value, 1.0, 1e-12);
  EXPECT_NEAR(estimate(analysis, {.policy = "dstar", .name = "median_slope"}).value, 1.0, 1e-12);
  EXPECT_EQ(estimate(analysis, {.name = "did_not_act"}).value, 0.0);
  EXPECT_EQ(estimate(analysis, {.name = "delay_moved"}).unit, "s");
  EXPECT_NEAR(estimate(analysis, {.perturbation = "later_1.0", .name = "partner_shift"}).value, 1.0, 1e-12);
  EXPECT_NEAR(estimate(analysis, {.perturbation = "later_1.0", .name = "robot_shift"}).value, 1.0, 1e-12);
}

TEST(Reactivity, TheSameEpisodeTwiceIsRefused) {
  std::vector<EpisodeRow> rows = shifted("dstar", 1.0);
  rows.push_back(rows.front());
  EXPECT_SENTENCE(thrown_message<InputError>([&] { reactivity_analysis(rows); }));
}

TEST(Reactivity, TheNoteNamesTheLevelOfItsIntervals) { EXPECT_SENTENCE(text_of(shifted("dstar", 1.0))); }

}  // namespace
}  // namespace duet
