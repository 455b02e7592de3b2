#include <gmock/gmock.h>

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
using testing::AllOf;
using testing::HasSubstr;

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
