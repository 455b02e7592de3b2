#include <gmock/gmock.h>

#include <cmath>

#include "duet/core/require.h"
#include "duet/report/studies/studies.h"
#include "tests/report/estimates.h"
#include "tests/rows/rows.h"
#include "tests/support.h"

namespace duet {
namespace {

using test::engine_episode;
using test::estimate;
using test::thrown_message;
using testing::AllOf;
using testing::HasSubstr;
using testing::Not;

EpisodeRow controlled(const std::string& engine, const std::string& controller, int number, double hf_ratio) {
  EpisodeRow row = engine_episode(engine, "replay", number, true, controller);
  row.metrics = {{"hf_ratio", hf_ratio},        {"hf_ratio_reference", 0.125}, {"dof_jerk", 800.0},
                 {"dof_jerk_reference", 200.0}, {"root_jerk", 50.0},           {"root_jerk_reference", 25.0},
                 {"root_error", 0.25},          {"root_angle_error", 7.5},     {"dof_error", 0.0625},
                 {"dof_velocity_error", 0.5}};
  return row;
}

std::vector<EpisodeRow> two_controllers() {
  std::vector<EpisodeRow> rows;
  for (int i = 0; i < 6; ++i) {
    rows.push_back(controlled("mujoco", "vmc", i, 0.25 + 0.0625 * (i % 2)));
    rows.push_back(controlled("bullet", "wbc_sim", i, 0.5));
  }
  return rows;
}

std::string text_of(const std::vector<EpisodeRow>& rows) { return analysis_markdown(controller_analysis(rows)); }

Estimate of_controller(const std::vector<EpisodeRow>& rows, const char* controller, const char* name) {
  return estimate(controller_analysis(rows), {.controller = controller, .name = name});
}

TEST(ControllerTable, MeansAreOverEpisodesWithTheirInterval) {
  const std::vector<EpisodeRow> rows = two_controllers();
  const Estimate after = of_controller(rows, "vmc", "hf_ratio");
  EXPECT_EQ(after.engine, "mujoco");
  EXPECT_EQ(after.n, 6);
  EXPECT_DOUBLE_EQ(after.value, 0.28125);
  EXPECT_LE(after.interval.low, after.value);
  EXPECT_GE(after.interval.high, after.value);
  EXPECT_LT(after.interval.low, after.interval.high);
  EXPECT_DOUBLE_EQ(of_controller(rows, "vmc", "hf_ratio_reference").value, 0.125);
  EXPECT_DOUBLE_EQ(of_controller(rows, "wbc_sim", "hf_ratio").interval.high, 0.5);  // all the same: no width
}

TEST(ControllerTable, OneClipHasNoInterval) {
  const std::vector<EpisodeRow> rows = {controlled("mujoco", "vmc", 0, 0.25), controlled("mujoco", "vmc", 1, 0.5)};
  EXPECT_DOUBLE_EQ(of_controller(rows, "vmc", "hf_ratio").value, 0.375);
  EXPECT_TRUE(std::isnan(of_controller(rows, "vmc", "hf_ratio").interval.low));
  EXPECT_THAT(text_of(rows), HasSubstr("    0.375 |"));
}

TEST(ControllerTable, SurvivalCountsEveryOtherEndAsNone) {
  std::vector<EpisodeRow> rows = two_controllers();
  rows[0].outcome = Outcome::kFell;
  rows[2].outcome = Outcome::kDiverged;
  rows[4].outcome = Outcome::kError;
  rows[6].fell = true;  // ended well but on the ground
  const Estimate survival = of_controller(rows, "vmc", "survival");
  EXPECT_EQ(survival.n, 6);
  EXPECT_EQ(survival.k, 2);
  EXPECT_DOUBLE_EQ(survival.interval.low, wilson(2, 6).low);
}

TEST(ControllerTable, FaultsAndSafeStopsAreCounted) {
  std::vector<EpisodeRow> rows = two_controllers();
  rows[0].faults.actions = 3;
  rows[2].faults = {.observations = 40, .actions = 0, .stopped = true};
  EXPECT_EQ(of_controller(rows, "vmc", "faulty").value, 2.0);
  EXPECT_EQ(of_controller(rows, "vmc", "stopped").value, 1.0);
  EXPECT_EQ(of_controller(rows, "wbc_sim", "faulty").value, 0.0);
  EXPECT_THAT(text_of(rows), HasSubstr("2 (1 stopped)"));
}

TEST(ControllerTable, EpisodesThatCouldNotRunAreInNoFigure) {
  std::vector<EpisodeRow> rows = two_controllers();
  for (int i = 0; i < 3; ++i) {
    rows.push_back(engine_episode("mujoco", "replay", i, false, "homie"));
    rows.back().outcome = Outcome::kUnsupported;
  }
  EXPECT_EQ(of_controller(rows, "homie", "survival").n, 0);
  EXPECT_EQ(of_controller(rows, "homie", "unsupported").value, 3.0);
  EXPECT_TRUE(std::isnan(of_controller(rows, "homie", "hf_ratio").value));
  EXPECT_SENTENCE(text_of(rows));
}

TEST(ControllerTable, PlaybackAndOtherArmsAreLeftOut) {
  std::vector<EpisodeRow> rows = {controlled("playback", "vmc", 0, 0.1), controlled("mujoco", "vmc", 0, 0.1)};
  rows.back().arm = "null";
  EXPECT_TRUE(controller_analysis(rows).empty());
  EXPECT_EQ(text_of(rows), "No episode ran under a controller in a physics engine.\n");
  EXPECT_TRUE(controller_analysis({}).empty());
}

TEST(ControllerTable, CleanComesBeforePerturbationsAndTheyAreNamed) {
  std::vector<EpisodeRow> rows = two_controllers();
  EXPECT_THAT(text_of(rows), AllOf(HasSubstr("Perturbation clean."), Not(HasSubstr("| Perturbation |"))));
  EpisodeRow pushed = controlled("bullet", "wbc_sim", 0, 0.75);
  pushed.perturbation = "a_push";
  rows.insert(rows.begin(), pushed);
  EXPECT_THAT(values_of(controller_analysis(rows).estimates, &Estimate::perturbation),
              testing::ElementsAre("clean", "a_push"));
  EXPECT_THAT(text_of(rows), HasSubstr("| Perturbation "));
}

TEST(ControllerTable, ThePapersRowsStandBesideOursAndSaySo) {
  const Analysis analysis = controller_analysis(two_controllers());
  const std::string text = analysis_markdown(analysis);
  EXPECT_THAT(text, AllOf(HasSubstr("the paper's"), HasSubstr("D-STAR"), HasSubstr("another experiment")));
  EXPECT_THAT(text, AllOf(HasSubstr("0.614"), HasSubstr("52.6"), HasSubstr("0.446")));
  const auto printed = [&](const char* policy, const char* controller, const char* name) {
    return estimate(analysis, {.source = "paper", .controller = controller, .policy = policy, .name = name});
  };
  EXPECT_EQ(printed("D-STAR", "WBC-Sim", "hf_ratio").value, 0.614);
  EXPECT_EQ(printed("DP", "WBC-Sim", "dof_jerk_reference").value, 180.0);
  EXPECT_EQ(printed("DP", "TWIST2", "dof_velocity_error").unit, "rad/s");
}

TEST(ControllerTable, FiguresAreOfEachControllerAndEngine) {
  const Analysis analysis = controller_analysis(two_controllers());
  const Estimate ratio =
      estimate(analysis, {.engine = "mujoco", .controller = "vmc", .perturbation = "clean", .name = "hf_ratio"});
  EXPECT_EQ(ratio.n, 6);
  EXPECT_DOUBLE_EQ(ratio.value, 0.28125);
  EXPECT_LT(ratio.interval.low, ratio.interval.high);
  const Estimate survival = estimate(analysis, {.engine = "bullet", .controller = "wbc_sim", .name = "survival"});
  EXPECT_EQ(survival.k, 6);
  EXPECT_DOUBLE_EQ(survival.value, 1.0);
}

TEST(ControllerTable, OrderOfRowsDoesNotMatter) {
  std::vector<EpisodeRow> rows = two_controllers();
  const std::string before = analysis_csv(controller_analysis(rows));
  std::reverse(rows.begin(), rows.end());
  EXPECT_EQ(analysis_csv(controller_analysis(rows)), before);
}

TEST(ControllerTable, TheSameEpisodeTwiceIsRefused) {
  std::vector<EpisodeRow> rows = two_controllers();
  rows.push_back(rows.front());
  EXPECT_SENTENCE(thrown_message<InputError>([&] { controller_analysis(rows); }));
}

}  // namespace
}  // namespace duet
