#include "duet/report/studies/degradation.h"

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

std::string text_of(const Degradation& result) { return analysis_markdown(degradation_analysis(result)); }

TEST(Degradation, ANameThatSaysAnotherSizeIsNotBelieved) {
  std::vector<EpisodeRow> rows;
  add_episodes({.successes = "1111"}, rows);
  add_episodes({.perturbation = "push_60n", .successes = "0111", .tags = size_tags("push", 5.0, "N")}, rows);
  add_episodes({.perturbation = "jitter_1cm", .successes = "0111"}, rows);  // its suite says no size
  const Degradation result = degradation(rows);
  ASSERT_EQ(result.curves.size(), 1U);
  EXPECT_EQ(result.curves[0].family, "push");
  EXPECT_EQ(result.curves[0].largest, 5.0);
  const Figure size = figure(degradation_analysis(result), {.perturbation = "push_60n", .of = "push", .name = "size"});
  EXPECT_EQ(size.value, 5.0);
  EXPECT_EQ(size.unit, "N");
}

TEST(Degradation, SizesOfOneKindThatDifferInMoreAreTwoCurves) {
  std::vector<EpisodeRow> rows;
  add_episodes({.successes = "1111"}, rows);
  add_episodes({.perturbation = "a", .successes = "0111", .tags = size_tags("push", 20.0, "N", "duration: 1")}, rows);
  add_episodes({.perturbation = "b", .successes = "0011", .tags = size_tags("push", 40.0, "N", "duration: 1")}, rows);
  add_episodes({.perturbation = "c", .successes = "0001", .tags = size_tags("push", 30.0, "N", "duration: 9")}, rows);
  const Degradation result = degradation(rows);
  ASSERT_EQ(result.curves.size(), 2U);
  EXPECT_EQ(result.curves[0].family, "push (duration: 1)");
  EXPECT_EQ(result.curves[0].points.size(), 3U);
  EXPECT_EQ(result.curves[1].family, "push (duration: 9)");
  EXPECT_EQ(result.curves[1].largest, 30.0);
}

TEST(Degradation, LossIsPairedWithTheCleanEpisodes) {
  const Degradation result = degradation(jittered());
  ASSERT_EQ(result.success.size(), 5U);
  EXPECT_EQ(result.success[0].perturbation, "clean");
  EXPECT_EQ(result.success[0].difference.pairs, 0);
  EXPECT_EQ(result.success[1].perturbation, "jitter_1cm");
  EXPECT_EQ(result.success[3].perturbation, "jitter_5cm");
  EXPECT_EQ(result.success[4].perturbation, "vanish");
  const PerturbedSuccess& two = result.success[2];
  EXPECT_EQ(two.success.k, 2);
  EXPECT_EQ(two.paper.k, 2);
  EXPECT_EQ(two.difference.pairs, 4);
  EXPECT_DOUBLE_EQ(two.difference.difference, -0.5);
  EXPECT_LT(two.difference.interval.low, newcombe_paired(2, 0, 2, 0).low);  // four draws of two clips
}

TEST(Degradation, OnlyEpisodesOfBothPair) {
  std::vector<EpisodeRow> rows;
  add_episodes({.successes = "11"}, rows);
  add_episodes({.perturbation = "vanish", .successes = "01", .first = 1}, rows);
  const Degradation result = degradation(rows);
  EXPECT_EQ(result.success[1].difference.pairs, 1);
  EXPECT_DOUBLE_EQ(result.success[1].difference.difference, -1.0);
}

TEST(Degradation, AreaOfACurveIsByTrapezia) {
  const Degradation result = degradation(jittered());
  ASSERT_EQ(result.curves.size(), 1U);
  const DegradationCurve& curve = result.curves[0];
  EXPECT_EQ(curve.family, "jitter");
  EXPECT_EQ(curve.unit, "m");
  ASSERT_EQ(curve.points.size(), 4U);
  EXPECT_EQ(curve.points[0].x, 0.0);
  EXPECT_EQ(curve.points[0].success, 1.0);
  // (0.875 * 1 + 0.625 * 1 + 0.5 * 3) / 5
  EXPECT_NEAR(curve.normalised_area, 0.6, 1e-12);
  EXPECT_DOUBLE_EQ(curve.largest, 0.05);
  EXPECT_DOUBLE_EQ(curve.difference.difference, -0.5);
}

TEST(Degradation, SizesOnBothSidesOfZeroAreOneCurve) {
  std::vector<EpisodeRow> rows;
  add_episodes({.successes = "1100"}, rows);
  add_episodes({.perturbation = "early", .successes = "0000", .tags = size_tags("partner.shift_s", -1.0, "s")}, rows);
  add_episodes({.perturbation = "late", .successes = "1100", .tags = size_tags("partner.shift_s", 0.5, "s")}, rows);
  const Degradation result = degradation(rows);
  ASSERT_EQ(result.curves.size(), 1U);
  EXPECT_DOUBLE_EQ(result.curves[0].points[0].x, -1.0);
  EXPECT_DOUBLE_EQ(result.curves[0].largest, -1.0);
  EXPECT_NEAR(result.curves[0].normalised_area, (0.25 + 0.25) / (1.5 * 0.5), 1e-12);
}

TEST(Degradation, ACurveThatNeverSucceedsHasNoArea) {
  std::vector<EpisodeRow> rows;
  add_episodes({.successes = "00"}, rows);
  add_episodes({.perturbation = "jitter_1cm", .successes = "00", .tags = size_tags("jitter", 0.01, "m")}, rows);
  EXPECT_TRUE(std::isnan(degradation(rows).curves.at(0).normalised_area));
}

TEST(Degradation, ThePapersCurveStandsBesideOurs) {
  const Degradation result = degradation(jittered());
  ASSERT_EQ(result.paper.size(), 1U);
  EXPECT_NEAR(result.paper[0].difference.difference, -0.071, 1e-12);
  // (82.55 * 1 + 79.8 * 1 + 78.6 * 3) / 5 / 84.9
  EXPECT_NEAR(result.paper[0].normalised_area, 398.15 / 5.0 / 84.9, 1e-12);
  const std::vector<LinePlot> plots = degradation_analysis(result).plots.at(0).plots;
  ASSERT_EQ(plots.size(), 1U);
  EXPECT_EQ(plots[0].x_label, "jitter [m]");
  ASSERT_EQ(plots[0].series.size(), 2U);
  EXPECT_EQ(plots[0].series[1].y.back(), 77.8);
  EXPECT_THAT(text_of(result), AllOf(HasSubstr("D-STAR (the paper's)"), HasSubstr("-7.1")));
}

TEST(Degradation, TheTableSaysItsLevel) {
  IntervalOptions options;
  EXPECT_THAT(text_of(degradation(jittered(), options)), HasSubstr("with 95 % Wilson intervals"));
  options.level = 0.9;
  EXPECT_THAT(text_of(degradation(jittered(), options)), HasSubstr("with 90 % Wilson intervals"));
}

TEST(Degradation, CleanAloneSaysSo) {
  std::vector<EpisodeRow> rows;
  add_episodes({}, rows);
  add_episodes({.policy = "dp", .perturbation = "vanish"}, rows);  // never clean
  const Degradation result = degradation(rows);
  EXPECT_TRUE(result.success.empty());
  EXPECT_EQ(text_of(result), "No policy ran both clean and perturbed.\n");
  EXPECT_TRUE(degradation_analysis(result).empty());
}

TEST(Degradation, FiguresAreOfPerturbationsAndOfFamilies) {
  const Analysis analysis = degradation_analysis(degradation(jittered()));
  const Figure loss = figure(analysis, {.policy = "dstar", .perturbation = "jitter_2cm", .name = "against_clean"});
  EXPECT_EQ(loss.n, 4);
  EXPECT_EQ(loss.value, -0.5);
  EXPECT_EQ(figure(analysis, {.policy = "dstar", .perturbation = "clean", .name = "paper_success"}).value, 0.0);
  const Figure size = figure(analysis, {.perturbation = "jitter_2cm", .of = "jitter", .name = "size"});
  EXPECT_EQ(size.value, 0.02);
  EXPECT_EQ(size.unit, "m");
  EXPECT_NEAR(figure(analysis, {.of = "jitter", .name = "normalised_area"}).value, 0.6, 1e-12);
  EXPECT_EQ(figure(analysis, {.of = "jitter", .name = "largest"}).value, 0.05);
  EXPECT_NEAR(figure(analysis, {.source = "paper", .of = "jitter", .name = "loss_at_largest"}).value, -0.071, 1e-12);
  EXPECT_EQ(
      figure(analysis, {.source = "paper", .perturbation = "jitter_0.05m", .of = "jitter", .name = "success"}).value,
      0.778);
}

TEST(Degradation, TheSameEpisodeTwiceIsRefused) {
  std::vector<EpisodeRow> rows = jittered();
  rows.push_back(rows.front());
  EXPECT_THAT(thrown_message<InputError>([&] { degradation(rows); }), HasSubstr("is there twice"));
}

}  // namespace
}  // namespace duet
