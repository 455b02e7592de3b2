#include "duet/report/studies/reactivity.h"

#include <gmock/gmock.h>

#include <cmath>

#include "duet/core/require.h"
#include "tests/report/figures.h"
#include "tests/report/policy_rows.h"
#include "tests/support.h"

namespace duet {
namespace {

using test::add_episodes;
using test::figure;
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
  EXPECT_EQ(reactivity_table(rows).timing.at(0).false_starts, 0);
  EXPECT_EQ(reactivity_table(rows).timing.at(0).led, 24);
  rows[0].metrics["onset_s"] = rows[0].metrics.at("partner_onset_s") - 0.31;
  rows[1].metrics["onset_s"] = rows[1].metrics.at("partner_onset_s") - 0.29;
  for (const int i : {2, 3}) rows[i].verdicts.emplace_back().version = "interaction";
  rows[2].verdicts.back().values = {{"lead_s", 0.4}};  // the other never begins
  const ReactivityTable table = reactivity_table(rows);
  EXPECT_EQ(table.timing.at(0).false_starts, 2);
  EXPECT_EQ(table.timing.at(0).led, 23);
  const Analysis analysis = reactivity_analysis(table);
  EXPECT_EQ(figure(analysis, {.name = "false_starts"}).value, 2.0);
  EXPECT_THAT(analysis_markdown(analysis), HasSubstr("2/23"));
}

std::string text_of(const ReactivityTable& table) { return analysis_markdown(reactivity_analysis(table)); }

TEST(Reactivity, AFollowerHasSlopeOneAndAReplayNone) {
  std::vector<EpisodeRow> rows = shifted("dstar", 1.0);
  const std::vector<EpisodeRow> replay = shifted("replay", 0.0);
  rows.insert(rows.end(), replay.begin(), replay.end());
  const ReactivityTable table = reactivity_table(rows);
  ASSERT_EQ(table.timing.size(), 2U);
  const Reactivity& dstar = table.timing[0];
  EXPECT_EQ(dstar.n, 12);  // jitter moves nobody
  EXPECT_NEAR(dstar.slope, 1.0, 1e-12);
  EXPECT_NEAR(dstar.interval.low, 1.0, 1e-12);
  EXPECT_NEAR(dstar.delay_clean, 0.5, 1e-12);
  EXPECT_NEAR(dstar.delay_moved, 0.5, 1e-12);
  EXPECT_EQ(dstar.n_clean, 6);
  EXPECT_NEAR(table.timing[1].slope, 0.0, 1e-12);
  EXPECT_NEAR(table.timing[1].delay_moved, 0.25, 1e-12);  // half of them -0.5, half of them 1.0
}

TEST(Reactivity, SlopeIsLeastSquaresThroughTheOrigin) {
  std::vector<EpisodeRow> rows;
  add_shifted("dstar", "clean", 0.0, 0.0, rows);
  add_shifted("dstar", "later_1.0", 1.0, 1.0, rows);
  add_shifted("dstar", "later_2.0", 2.0, 0.5, rows);
  const Reactivity of = reactivity_table(rows).timing.at(0);
  EXPECT_NEAR(of.slope, (1.0 * 1.0 + 2.0 * 1.0) / (1.0 + 4.0), 1e-12);
  ASSERT_EQ(of.shifts.size(), 2U);
  EXPECT_NEAR(of.shifts[1].partner, 2.0, 1e-12);
  EXPECT_NEAR(of.shifts[1].robot, 1.0, 1e-12);
}

TEST(Reactivity, MedianSlopeIsThatOfMostEpisodes) {
  std::vector<EpisodeRow> rows = shifted("dstar", 1.0);
  rows.at(6).metrics["onset_s"] = 0.0;  // an arm that swung, of one episode of later_1.0
  const Reactivity of = reactivity_table(rows).timing.at(0);
  EXPECT_LT(of.slope, 0.9);
  EXPECT_NEAR(of.median_slope, 1.0, 1e-12);
  EXPECT_NEAR(of.median_interval.high, 1.0, 1e-12);
}

TEST(Reactivity, EachOfSeveralTasksHasItsLine) {
  std::vector<EpisodeRow> rows = shifted("dstar", 1.0);
  std::vector<EpisodeRow> waves = shifted("dstar", 0.5);
  for (EpisodeRow& row : waves) row.task = "wave";
  rows.insert(rows.end(), waves.begin(), waves.end());
  const ReactivityTable table = reactivity_table(rows);
  ASSERT_EQ(table.timing.size(), 3U);
  EXPECT_EQ(table.timing[0].task, "all");
  EXPECT_EQ(table.timing[0].n, 24);
  EXPECT_EQ(table.timing[1].task, "hug");
  EXPECT_NEAR(table.timing[1].slope, 1.0, 1e-12);
  EXPECT_EQ(table.timing[2].task, "wave");
  EXPECT_NEAR(table.timing[2].slope, 0.5, 1e-12);
  const Analysis analysis = reactivity_analysis(table);
  EXPECT_NEAR(figure(analysis, {.policy = "dstar", .task = "wave", .name = "slope"}).value, 0.5, 1e-12);
  EXPECT_EQ(analysis.plots.at(0).plots.at(0).series.size(), 1U);
}

TEST(Reactivity, OneClipHasNoInterval) {
  std::vector<EpisodeRow> rows = shifted("dstar", 1.0);
  std::erase_if(rows, [](const EpisodeRow& row) { return row.clip != "hug-0"; });
  const ReactivityTable table = reactivity_table(rows);
  EXPECT_TRUE(std::isnan(table.timing.at(0).interval.low));
  EXPECT_THAT(text_of(table), HasSubstr(" 1.00 |"));
}

TEST(Reactivity, RobotsThatDidNotActAreCountedAndInNoSlope) {
  std::vector<EpisodeRow> rows = shifted("dstar", 1.0);
  for (EpisodeRow& row : rows)
    if (row.perturbation == "later_1.0") row.metrics.erase("onset_s");
  const Reactivity of = reactivity_table(rows).timing.at(0);
  EXPECT_EQ(of.n, 6);
  EXPECT_EQ(of.without, 6);
  for (EpisodeRow& row : rows) row.metrics.erase("onset_s");
  const ReactivityTable none = reactivity_table(rows);
  EXPECT_EQ(none.timing.at(0).without, 12);
  EXPECT_TRUE(std::isnan(none.timing.at(0).slope));
  EXPECT_THAT(text_of(none), HasSubstr(" 12 |"));
  EXPECT_TRUE(reactivity_analysis(none).plots.at(0).plots.empty());
}

TEST(Reactivity, WithoutAMovedPartnerOrVariantsThereIsNothing) {
  std::vector<EpisodeRow> rows = shifted("dstar", 1.0);
  std::erase_if(rows, [](const EpisodeRow& row) { return row.perturbation == "clean"; });
  const ReactivityTable table = reactivity_table(rows);
  EXPECT_TRUE(table.empty());
  EXPECT_THAT(text_of(table), HasSubstr("No perturbation moved a partner's onset"));
  EXPECT_TRUE(reactivity_analysis(table).empty());
}

void offer(const std::string& side, const std::string& height, EpisodeRow& row) {
  test::set_tag(row, kSideTag, side);
  test::set_tag(row, kHeightTag, height);
}

TEST(Reactivity, VariantsOfOneHeightOrOfThreeAreNoTable) {
  std::vector<EpisodeRow> rows;
  add_episodes({.task = "handshake", .successes = "110"}, rows);
  for (EpisodeRow& row : rows) row.clip = "handshake-0-left_high";
  EXPECT_TRUE(reactivity_table(rows).spatial.empty());  // names say nothing
  for (EpisodeRow& row : rows) offer("left", "0.9", row);
  EXPECT_TRUE(reactivity_table(rows).spatial.empty());
  offer("left", "1", rows[0]);
  EXPECT_EQ(reactivity_table(rows).spatial.size(), 1U);
  offer("left", "1.15", rows[1]);
  EXPECT_TRUE(reactivity_table(rows).spatial.empty());
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
  const ReactivityTable table = reactivity_table(rows);
  ASSERT_EQ(table.spatial.size(), 1U);
  EXPECT_EQ(table.spatial[0].cells[0].k, 3);
  EXPECT_EQ(table.spatial[0].cells[3].k, 1);
  EXPECT_EQ(table.spatial[0].cells[1].n, 0);
  const Analysis analysis = reactivity_analysis(table);
  const std::vector<TitledTable>& tables = analysis.tables;
  ASSERT_EQ(tables.size(), 1U);
  EXPECT_EQ(tables[0].table.rows.at(1),
            (std::vector<std::string>{"D-STAR (the paper's)", "Handshake", "80.0", "100.0", "40.0", "60.0"}));
  EXPECT_THAT(text_of(table), AllOf(HasSubstr("75.0 ["), HasSubstr("0.9 m is low, 1.15 m high"),
                                    HasSubstr("real robot"), Not(HasSubstr("Slope"))));
  EXPECT_EQ(figure(analysis, {.policy = "dstar", .task = "handshake", .of = "left_high", .name = "success"}).k, 3);
  EXPECT_EQ(figure(analysis, {.source = "paper", .task = "handshake", .of = "left_low", .name = "success"}).value, 0.4);
}

TEST(Reactivity, PlotShowsTheShiftsOfEveryPolicy) {
  const Analysis analysis = reactivity_analysis(reactivity_table(shifted("dstar", 1.0)));
  const std::vector<LinePlot>& plots = analysis.plots.at(0).plots;
  ASSERT_EQ(plots.size(), 1U);
  ASSERT_EQ(plots[0].series.size(), 1U);
  EXPECT_THAT(plots[0].series[0].x,
              testing::ElementsAre(testing::DoubleNear(-0.5, 1e-12), testing::DoubleNear(1.0, 1e-12)));
}

TEST(Reactivity, FiguresAreOfPoliciesAndOfPerturbations) {
  const Analysis analysis = reactivity_analysis(reactivity_table(shifted("dstar", 1.0)));
  EXPECT_NEAR(figure(analysis, {.policy = "dstar", .name = "slope"}).value, 1.0, 1e-12);
  EXPECT_NEAR(figure(analysis, {.policy = "dstar", .name = "median_slope"}).value, 1.0, 1e-12);
  EXPECT_EQ(figure(analysis, {.name = "did_not_act"}).value, 0.0);
  EXPECT_EQ(figure(analysis, {.name = "delay_moved"}).unit, "s");
  EXPECT_NEAR(figure(analysis, {.perturbation = "later_1.0", .name = "partner_shift"}).value, 1.0, 1e-12);
  EXPECT_NEAR(figure(analysis, {.perturbation = "later_1.0", .name = "robot_shift"}).value, 1.0, 1e-12);
}

TEST(Reactivity, TheSameEpisodeTwiceIsRefused) {
  std::vector<EpisodeRow> rows = shifted("dstar", 1.0);
  rows.push_back(rows.front());
  EXPECT_THAT(thrown_message<InputError>([&] { reactivity_table(rows); }), HasSubstr("is there twice"));
}

TEST(Reactivity, TheNoteNamesTheLevelOfItsIntervals) {
  EXPECT_THAT(text_of(reactivity_table(shifted("dstar", 1.0))), HasSubstr("with a 95 % interval"));
}

}  // namespace
}  // namespace duet
