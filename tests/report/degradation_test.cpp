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
using test::size_tags;
using test::thrown_message;
using testing::AllOf;
using testing::HasSubstr;

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

}  // namespace
}  // namespace duet
