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
using test::estimates_like;
using test::size_tags;
using test::thrown_message;
using ::testing::AllOf;
using ::testing::HasSubstr;

// Clean 4 of 4, jitter 1 cm 3 of 4, 2 cm 2 of 4, 5 cm 2 of 4.
std::vector<EpisodeRow> jittered() {
  std::vector<EpisodeRow> rows;
  add_episodes({.perturbation = "jitter_5cm", .successes = "0011", .tags = size_tags("jitter", 0.05, "m")}, rows);
  add_episodes({.perturbation = "clean", .successes = "1111"}, rows);
  add_episodes({.perturbation = "jitter_2cm", .successes = "0101", .tags = size_tags("jitter", 0.02, "m")}, rows);
  add_episodes({.perturbation = "jitter_1cm", .successes = "1101", .tags = size_tags("jitter", 0.01, "m")}, rows);
  add_episodes({.perturbation = "vanish", .successes = "0000"}, rows);
  return rows;
}

std::string text_of(const Analysis& analysis) { return analysis_markdown(analysis); }

// Families that have a curve, ours.
std::vector<std::string> families(const Analysis& analysis) {
  std::vector<std::string> found;
  for (const Estimate& estimate : analysis.estimates)
    if (estimate.name == "normalised_area" && estimate.source == "duet") found.push_back(estimate.of);
  return found;
}

TEST(Degradation, ANameThatSaysAnotherSizeIsNotBelieved) {
  std::vector<EpisodeRow> rows;
  add_episodes({.successes = "1111"}, rows);
  add_episodes({.perturbation = "push_60n", .successes = "0111", .tags = size_tags("push", 5.0, "N")}, rows);
  add_episodes({.perturbation = "jitter_1cm", .successes = "0111"}, rows);  // its suite says no size
  const Analysis analysis = degradation_analysis(rows);
  EXPECT_THAT(families(analysis), testing::ElementsAre("push"));
  EXPECT_EQ(estimate(analysis, {.of = "push", .name = "largest"}).value, 5.0);
  const Estimate size = estimate(analysis, {.perturbation = "push_60n", .of = "push", .name = "size"});
  EXPECT_EQ(size.value, 5.0);
  EXPECT_EQ(size.unit, "N");
}

TEST(Degradation, SizesOfOneKindThatDifferInMoreAreTwoCurves) {
  std::vector<EpisodeRow> rows;
  add_episodes({.successes = "1111"}, rows);
  add_episodes({.perturbation = "a", .successes = "0111", .tags = size_tags("push", 20.0, "N", "duration: 1")}, rows);
  add_episodes({.perturbation = "b", .successes = "0011", .tags = size_tags("push", 40.0, "N", "duration: 1")}, rows);
  add_episodes({.perturbation = "c", .successes = "0001", .tags = size_tags("push", 30.0, "N", "duration: 9")}, rows);
  const Analysis analysis = degradation_analysis(rows);
  EXPECT_THAT(families(analysis), testing::ElementsAre("push (duration: 1)", "push (duration: 9)"));
  EXPECT_EQ(estimate(analysis, {.of = "push (duration: 1)", .name = "normalised_area"}).n, 3);  // points
  EXPECT_EQ(estimate(analysis, {.of = "push (duration: 9)", .name = "largest"}).value, 30.0);
}

TEST(Degradation, LossIsPairedWithTheCleanEpisodes) {
  const Analysis analysis = degradation_analysis(jittered());
  EXPECT_THAT(values_of(analysis.estimates, &Estimate::perturbation),
              testing::ElementsAre("clean", "jitter_1cm", "jitter_2cm", "jitter_5cm", "vanish", "jitter_0.01m",
                                   "jitter_0.02m", "jitter_0.05m"));
  EXPECT_TRUE(test::estimates_like(analysis, {.perturbation = "clean", .name = "against_clean"}).empty());
  EXPECT_EQ(estimate(analysis, {.perturbation = "jitter_2cm", .name = "success"}).k, 2);
  EXPECT_EQ(estimate(analysis, {.perturbation = "jitter_2cm", .name = "paper_success"}).k, 2);
  const Estimate loss = estimate(analysis, {.perturbation = "jitter_2cm", .name = "against_clean"});
  EXPECT_EQ(loss.n, 4);
  EXPECT_DOUBLE_EQ(loss.value, -0.5);
  EXPECT_LT(loss.interval.low, newcombe_paired(2, 0, 2, 0).low);  // four draws of two clips
}

TEST(Degradation, OnlyEpisodesOfBothPair) {
  std::vector<EpisodeRow> rows;
  add_episodes({.successes = "11"}, rows);
  add_episodes({.perturbation = "vanish", .successes = "01", .first = 1}, rows);
  const Estimate loss = estimate(degradation_analysis(rows), {.perturbation = "vanish", .name = "against_clean"});
  EXPECT_EQ(loss.n, 1);
  EXPECT_DOUBLE_EQ(loss.value, -1.0);
}

TEST(Degradation, AreaOfACurveIsByTrapezia) {
  const Analysis analysis = degradation_analysis(jittered());
  const Estimate area = estimate(analysis, {.of = "jitter", .name = "normalised_area"});
  EXPECT_EQ(area.n, 4);  // points
  // (0.875 * 1 + 0.625 * 1 + 0.5 * 3) / 5
  EXPECT_NEAR(area.value, 0.6, 1e-12);
  EXPECT_DOUBLE_EQ(estimate(analysis, {.of = "jitter", .name = "largest"}).value, 0.05);
  EXPECT_EQ(estimate(analysis, {.of = "jitter", .name = "largest"}).unit, "m");
  EXPECT_DOUBLE_EQ(estimate(analysis, {.of = "jitter", .name = "loss_at_largest"}).value, -0.5);
  const LineSeries& series = analysis.plots.at(0).plots.at(0).series.at(0);
  EXPECT_EQ(series.x.front(), 0.0);
  EXPECT_EQ(series.y.front(), 100.0);
}

TEST(Degradation, SizesOnBothSidesOfZeroAreOneCurve) {
  std::vector<EpisodeRow> rows;
  add_episodes({.successes = "1100"}, rows);
  add_episodes({.perturbation = "early", .successes = "0000", .tags = size_tags("partner.shift_s", -1.0, "s")}, rows);
  add_episodes({.perturbation = "late", .successes = "1100", .tags = size_tags("partner.shift_s", 0.5, "s")}, rows);
  const Analysis analysis = degradation_analysis(rows);
  EXPECT_THAT(families(analysis), testing::ElementsAre("partner.shift_s"));
  EXPECT_EQ(analysis.plots.at(0).plots.at(0).series.at(0).x.front(), -1.0);
  EXPECT_DOUBLE_EQ(estimate(analysis, {.of = "partner.shift_s", .name = "largest"}).value, -1.0);
  EXPECT_NEAR(estimate(analysis, {.of = "partner.shift_s", .name = "normalised_area"}).value,
              (0.25 + 0.25) / (1.5 * 0.5), 1e-12);
}

TEST(Degradation, ACurveThatNeverSucceedsHasNoArea) {
  std::vector<EpisodeRow> rows;
  add_episodes({.successes = "00"}, rows);
  add_episodes({.perturbation = "jitter_1cm", .successes = "00", .tags = size_tags("jitter", 0.01, "m")}, rows);
  EXPECT_TRUE(std::isnan(estimate(degradation_analysis(rows), {.of = "jitter", .name = "normalised_area"}).value));
}

TEST(Degradation, ThePapersCurveStandsBesideOurs) {
  const Analysis analysis = degradation_analysis(jittered());
  const auto of_paper = [&](const char* name) {
    return estimate(analysis, {.source = "paper", .of = "jitter", .name = name}).value;
  };
  EXPECT_NEAR(of_paper("loss_at_largest"), -0.071, 1e-12);
  // (82.55 * 1 + 79.8 * 1 + 78.6 * 3) / 5 / 84.9
  EXPECT_NEAR(of_paper("normalised_area"), 398.15 / 5.0 / 84.9, 1e-12);
  const std::vector<LinePlot> plots = analysis.plots.at(0).plots;
  ASSERT_EQ(plots.size(), 1U);
  EXPECT_EQ(plots[0].x_label, "jitter [m]");
  ASSERT_EQ(plots[0].series.size(), 2U);
  EXPECT_EQ(plots[0].series[1].y.back(), 77.8);
  EXPECT_THAT(text_of(analysis), AllOf(HasSubstr("D-STAR (the paper's)"), HasSubstr("-7.1")));
}

TEST(Degradation, TheTableSaysItsLevel) {
  IntervalOptions options;
  EXPECT_SENTENCE(text_of(degradation_analysis(jittered(), options)));
  options.level = 0.9;
  EXPECT_SENTENCE(text_of(degradation_analysis(jittered(), options)));
}

TEST(Degradation, CleanAloneSaysSo) {
  std::vector<EpisodeRow> rows;
  add_episodes({}, rows);
  add_episodes({.policy = "dp", .perturbation = "vanish"}, rows);  // never clean
  const Analysis analysis = degradation_analysis(rows);
  EXPECT_EQ(text_of(analysis), "No policy ran both clean and perturbed.\n");
  EXPECT_TRUE(analysis.empty());
}

TEST(Degradation, FiguresAreOfPerturbationsAndOfFamilies) {
  const Analysis analysis = degradation_analysis(jittered());
  const Estimate loss = estimate(analysis, {.policy = "dstar", .perturbation = "jitter_2cm", .name = "against_clean"});
  EXPECT_EQ(loss.n, 4);
  EXPECT_EQ(loss.value, -0.5);
  EXPECT_EQ(estimate(analysis, {.policy = "dstar", .perturbation = "clean", .name = "paper_success"}).value, 0.0);
  const Estimate size = estimate(analysis, {.perturbation = "jitter_2cm", .of = "jitter", .name = "size"});
  EXPECT_EQ(size.value, 0.02);
  EXPECT_EQ(size.unit, "m");
  EXPECT_NEAR(estimate(analysis, {.of = "jitter", .name = "normalised_area"}).value, 0.6, 1e-12);
  EXPECT_EQ(estimate(analysis, {.of = "jitter", .name = "largest"}).value, 0.05);
  EXPECT_NEAR(estimate(analysis, {.source = "paper", .of = "jitter", .name = "loss_at_largest"}).value, -0.071, 1e-12);
  EXPECT_EQ(
      estimate(analysis, {.source = "paper", .perturbation = "jitter_0.05m", .of = "jitter", .name = "success"}).value,
      0.778);
}

TEST(Degradation, TheSameEpisodeTwiceIsRefused) {
  std::vector<EpisodeRow> rows = jittered();
  rows.push_back(rows.front());
  EXPECT_SENTENCE(thrown_message<InputError>([&] { degradation_analysis(rows); }));
}

// A perturbation's or a clip's.
Tags rung(std::string_view of, const std::string& word, int number, const std::string& name) {
  return {{row_tag(of, word), std::to_string(number)}, {row_tag(of, word + "_name"), name}};
}

Tags level(int number, const std::string& name) { return rung(kOfPerturbation, "level", number, name); }

// dstar passes 0 and 1, not 2, and 3 again; replay not even 0.
std::vector<EpisodeRow> ladder() {
  std::vector<EpisodeRow> rows;
  add_episodes({.successes = "1111"}, rows);
  add_episodes({.perturbation = "one", .successes = "0011", .tags = level(1, "waits")}, rows);
  add_episodes({.perturbation = "level_9_lies", .successes = "0001", .tags = level(2, "moves")}, rows);
  add_episodes({.perturbation = "three", .successes = "1110", .tags = level(3, "pushed")}, rows);
  add_episodes({.policy = "replay", .successes = "0001"}, rows);
  add_episodes({.policy = "replay", .perturbation = "one", .successes = "1111", .tags = level(1, "waits")}, rows);
  add_episodes({.policy = "null", .arm = "null", .successes = "0000"}, rows);
  add_episodes({.perturbation = "level_4_push", .successes = "0000"}, rows);  // on no level, whatever it is called
  return rows;
}

TEST(LevelTable, AScoreSaysWhereItEnds) {
  const Analysis analysis = level_analysis(ladder());
  ASSERT_EQ(analysis.tables.size(), 1U);
  const TextTable& table = analysis.tables[0].table;
  EXPECT_THAT(table.header,
              testing::ElementsAre("Policy", "0 clean", "1 waits", "2 moves", "3 pushed", "Mean [%]", "Reached"));
  ASSERT_EQ(table.rows.size(), 2U);  // the null arm has none
  const auto of = [&](const char* policy, const char* level, const char* name) {
    return estimate(analysis, {.policy = policy, .of = level, .name = name});
  };
  EXPECT_EQ(of("dstar", "level_1_waits", "success").k, 2);
  EXPECT_EQ(of("dstar", "level", "reached").value,
            1.0);  // a half is enough; what follows a failed level does not count
  EXPECT_DOUBLE_EQ(of("dstar", "level", "mean").value, (1.0 + 0.5 + 0.25 + 0.75) / 4.0);
  EXPECT_TRUE(estimates_like(analysis, {.policy = "replay", .of = "level", .name = "reached"}).empty());
  EXPECT_EQ(of("replay", "level_2_moves", "success").n, 0);
  EXPECT_DOUBLE_EQ(of("replay", "level", "mean").value, 0.625);  // of the levels that were run
}

// A push while the arms move is of the push's stage, whatever the arms do.
TEST(LevelTable, ARowIsOfTheHigherOfItsPerturbationAndItsClip) {
  std::vector<EpisodeRow> rows;
  const auto add = [&](const std::string& clip, int stage_of_clip, const std::string& perturbation, int stage,
                       const std::string& successes) {
    const std::size_t first = rows.size();
    Tags tags = rung(kOfClip, "stage", stage_of_clip, stage_of_clip == 1 ? "own" : "moving");
    if (stage > 0) tags.merge(rung(kOfPerturbation, "stage", stage, "pushed"));
    add_episodes({.policy = "velocity", .perturbation = perturbation, .successes = successes, .tags = tags}, rows);
    for (std::size_t i = first; i < rows.size(); ++i) {
      rows[i].clip = clip;
      rows[i].key = episode_key(rows[i]);
    }
  };
  add("own-stand", 1, "clean", 0, "11");
  add("own-forward", 1, "clean", 0, "10");
  add("moving-stand", 2, "clean", 0, "11");
  add("own-stand", 1, "pushed", 3, "01");
  add("moving-stand", 2, "pushed", 3, "00");
  add("moving-stand", 2, "kick", 0, "11");  // on no stage
  const Analysis analysis = level_analysis(rows);
  EXPECT_THAT(values_of(analysis.estimates, &Estimate::of),
              testing::ElementsAre("stage", "stage_1_own", "stage_2_moving", "stage_3_pushed"));
  const auto rate = [&](const char* stage) { return estimate(analysis, {.of = stage, .name = "success"}); };
  EXPECT_EQ(rate("stage_1_own").n, 4);
  EXPECT_EQ(rate("stage_1_own").k, 3);
  EXPECT_EQ(rate("stage_2_moving").n, 2);
  EXPECT_EQ(rate("stage_3_pushed").n, 4);
  EXPECT_EQ(rate("stage_3_pushed").k, 1);
  EXPECT_TRUE(estimates_like(analysis, {.of = "stage", .name = "reached"}).empty());  // 75 % of the first is not 95 %
}

TEST(LevelTable, WhoStandsWhereItShouldWalkDoesNotPass) {
  std::vector<EpisodeRow> rows;
  add_episodes({.policy = "velocity",
                .perturbation = "own",
                .successes = "1110",
                .tags = rung(kOfPerturbation, "stage", 1, "own")},
               rows);
  add_episodes({.policy = "velocity",
                .perturbation = "held",
                .successes = "1",
                .tags = rung(kOfPerturbation, "stage", 2, "held")},
               rows);
  rows[4].metrics = {{"command_forward", 0.0}, {"speed_forward", -0.001}};  // nobody asked it to walk
  for (const auto& [row, speed] : {std::pair(0, 0.3), std::pair(1, 0.15), std::pair(2, 0.14), std::pair(3, 0.3)}) {
    rows[row].metrics["command_forward"] = 0.3;
    rows[row].metrics["speed_forward"] = speed;
  }
  const Analysis analysis = level_analysis(rows);
  EXPECT_EQ(estimate(analysis, {.of = "stage_1_own", .name = "success"}).k, 2);
  EXPECT_EQ(estimate(analysis, {.of = "stage_2_held", .name = "success"}).k, 1);
}

TEST(LevelTable, RowsWithoutLevelsAreNoTable) {
  std::vector<EpisodeRow> rows;
  add_episodes({.successes = "11"}, rows);
  add_episodes({.perturbation = "push", .successes = "01"}, rows);
  EXPECT_TRUE(level_analysis(rows).empty());
  EXPECT_TRUE(level_analysis(rows).tables.empty());
  EXPECT_TRUE(level_analysis({}).empty());
}

TEST(LevelTable, TwoNamesOfOneLevelAreRefused) {
  std::vector<EpisodeRow> rows = ladder();
  add_episodes({.perturbation = "hurries", .successes = "1", .tags = level(1, "hurries")}, rows);
  EXPECT_SENTENCE(test::thrown_message<InputError>([&] { level_analysis(rows); }));
}

TEST(LevelTable, SaysWhatWasReached) {
  const Analysis analysis = level_analysis(ladder());
  EXPECT_THAT(analysis_markdown(analysis),
              AllOf(HasSubstr("### Levels"), HasSubstr(" 1 waits |"), HasSubstr("25.0 [2.7, 80.2]"),
                    HasSubstr("up to which success is 50 % or more"), HasSubstr("|    none |")));
  const auto reached = estimates_like(analysis, {.of = "level", .name = "reached"});
  ASSERT_EQ(reached.size(), 1U);  // the other policy reaches none
  EXPECT_EQ(reached[0].policy, "dstar");
  EXPECT_EQ(reached[0].value, 1.0);
  EXPECT_EQ(estimate(analysis, {.of = "level", .name = "pass"}).value, 0.5);
  const Estimate waits = estimate(analysis, {.policy = "dstar", .of = "level_1_waits", .name = "success"});
  EXPECT_EQ(waits.n, 4);
}

}  // namespace
}  // namespace duet
