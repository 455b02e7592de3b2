#include "duet/report/studies/attribution.h"

#include <gmock/gmock.h>

#include "duet/core/require.h"
#include "tests/report/estimates.h"
#include "tests/report/policy_rows.h"
#include "tests/support.h"

namespace duet {
namespace {

using test::add_episodes;
using test::estimate;
using testing::AllOf;
using testing::HasSubstr;
using testing::Not;

std::vector<EpisodeRow> cell(const std::string& successes) {
  std::vector<EpisodeRow> rows;
  for (std::size_t i = 0; i < successes.size(); ++i) {
    add_episodes({.engine = "bullet", .successes = successes.substr(i, 1), .first = static_cast<int>(i)}, rows);
    EpisodeRow& row = rows.back();
    row.clip = "hug-" + std::to_string(i);  // a clip an episode
    row.episode = 0;
    row.fell = successes[i] == '0';
    row.outcome = row.fell ? Outcome::kFell : Outcome::kOk;
    row.key = episode_key(row);
  }
  return rows;
}

std::string times(char letter, int count) { return std::string(static_cast<std::size_t>(count), letter); }

// Law and armature do nothing alone and half of it together, as in the review's table.
AttributionRows law_and_armature(int clips = 20) {
  const std::string all = times('1', clips), half = times('1', clips / 2) + times('0', clips / 2);
  return {.switches = {"law", "armature"},
          .settings = {"law implicit -> explicit", "armature 1 -> 0"},
          .cell_names = {"from", "law", "armature", "to"},
          .cells = {cell(all), cell(all), cell(all), cell(half)}};
}

TEST(Attribution, AnInteractionIsAnEffectOfItsOwn) {
  const Analysis analysis = attribution_analysis(law_and_armature());
  EXPECT_EQ(estimate(analysis, {.of = "law", .name = "effect_success"}).value, 0.0);
  EXPECT_EQ(estimate(analysis, {.of = "armature", .name = "effect_success"}).value, 0.0);
  const Estimate both = estimate(analysis, {.of = "law x armature", .name = "effect_success"});
  EXPECT_DOUBLE_EQ(both.value, -0.5);
  EXPECT_LT(both.interval.high, 0.0);
  EXPECT_EQ(both.n, 20);
  EXPECT_DOUBLE_EQ(estimate(analysis, {.of = "all switches", .name = "effect_success"}).value, -0.5);
  EXPECT_DOUBLE_EQ(estimate(analysis, {.of = "law x armature", .name = "effect_falls"}).value, 0.5);
}

TEST(Attribution, SharesOfTheGapSumToAll) {
  const Analysis analysis = attribution_analysis(law_and_armature());
  double sum = 0.0;
  for (const char* name : {"law", "armature"}) {
    sum += estimate(analysis, {.of = name, .name = "share_success"}).value;
    EXPECT_DOUBLE_EQ(estimate(analysis, {.of = name, .name = "shapley_success"}).value, -0.25);
    EXPECT_DOUBLE_EQ(estimate(analysis, {.of = name, .name = "last_success"}).value, -0.5);
  }
  EXPECT_NEAR(sum, 1.0, 1e-12);
}

TEST(Attribution, WithoutAGapNobodyHasAShareOfIt) {
  AttributionRows rows = law_and_armature();
  rows.cells.back() = rows.cells.front();
  const Analysis analysis = attribution_analysis(rows);
  EXPECT_TRUE(test::estimates_like(analysis, {.of = "law", .name = "share_success"}).empty());
  EXPECT_EQ(estimate(analysis, {.of = "all switches", .name = "found_success"}).text, "none: no gap");
}

TEST(Attribution, WhatWasFoundOnSomeClipsIsTriedOnTheOthers) {
  AttributionRows rows = law_and_armature(40);
  rows.switches.emplace_back("dt");  // which does nothing
  rows.settings.emplace_back("dt 0.002 -> 0.001");
  rows.cell_names = {"from", "law", "armature", "law+armature", "dt", "law+dt", "armature+dt", "to"};
  const std::vector<std::vector<EpisodeRow>> first = rows.cells;
  rows.cells.insert(rows.cells.end(), first.begin(), first.end());
  const Analysis analysis = attribution_analysis(rows);
  EXPECT_EQ(estimate(analysis, {.of = "all switches", .name = "found_success"}).text, "law + armature");
  const Estimate explained = estimate(analysis, {.of = "all switches", .name = "explained_success"});
  EXPECT_EQ(explained.n, 20);
  EXPECT_DOUBLE_EQ(explained.value, 1.0);
  const Analysis none = attribution_analysis(rows, {{}, 0.0});
  EXPECT_TRUE(test::estimates_like(none, {.of = "all switches", .name = "found_success"}).empty());
}

TEST(Attribution, EpisodesThatACellLacksAreLeftOut) {
  AttributionRows rows = law_and_armature();
  rows.cells[1].erase(rows.cells[1].begin(), rows.cells[1].begin() + 5);
  EXPECT_EQ(estimate(attribution_analysis(rows), {.of = "law", .name = "effect_success"}).n, 15);
  rows.cells[1].clear();
  EXPECT_THAT(test::thrown_message<InputError>([&] { attribution_analysis(rows); }), HasSubstr("no episode is in all"));
  rows.cells.pop_back();
  EXPECT_THAT(test::thrown_message<std::invalid_argument>([&] { attribution_analysis(rows); }),
              HasSubstr("expected 2^switches cells"));
}

TEST(Attribution, TheFigureGoesFromTheOneEndToTheOther) {
  const Analysis analysis = attribution_analysis(law_and_armature());
  const std::string bars = attribution_bars(analysis);
  EXPECT_THAT(bars, AllOf(HasSubstr("Success [%]: bullet"), HasSubstr("Falls [%]: bullet"),
                          HasSubstr("from            [" + times('#', 50) + " ] 100.0"),
                          HasSubstr("law             [" + times(' ', 50) + "|] +0.0 ["),
                          HasSubstr("law x armature  [" + times(' ', 25) + times('<', 25) + " ] -50.0 ["),
                          HasSubstr("to              [" + times('#', 25) + times(' ', 26) + "] 50.0")));
  const std::string svg = attribution_svg(analysis);
  EXPECT_THAT(svg, AllOf(HasSubstr("<svg"), HasSubstr("law x armature"), HasSubstr("-50.0 ["), Not(HasSubstr("nan"))));
}

TEST(Attribution, ItsTablesSayWhatEachSwitchTurns) {
  const std::string text = analysis_markdown(attribution_analysis(law_and_armature()));
  EXPECT_THAT(text, AllOf(HasSubstr("What makes the gap"), HasSubstr("law implicit -> explicit"),
                          HasSubstr("On clips that were held out"), HasSubstr("| law x armature ")));
}

}  // namespace
}  // namespace duet
