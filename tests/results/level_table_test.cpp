#include "duet/results/analyses/level_table.h"

#include <gmock/gmock.h>

#include "duet/core/require.h"
#include "tests/results/figures.h"
#include "tests/results/policy_rows.h"
#include "tests/support.h"

namespace duet {
namespace {

using test::add_episodes;
using test::figure;
using test::figures_like;
using testing::AllOf;
using testing::HasSubstr;

TEST(LevelName, IsANumberAndWords) {
  EXPECT_EQ(level_of("level", "level_3_walks_up"), (LevelName{3, "walks_up"}));
  EXPECT_EQ(level_of("level", "level_12"), (LevelName{12, ""}));
  EXPECT_EQ(level_of("stage", "stage_2_held-forward_0.3"), (LevelName{2, "held"}));
}

TEST(LevelName, OtherNamesHaveNone) {
  for (const char* name : {"clean", "level", "level_", "level_x", "level3", "levels_3", "level_3x", "level_-1",
                           "push_3", "stage_3", "level_99999999999"})
    EXPECT_FALSE(level_of("level", name).has_value()) << name;
}

// dstar passes 0 and 1, not 2, and 3 again; replay not even 0.
std::vector<EpisodeRow> ladder() {
  std::vector<EpisodeRow> rows;
  add_episodes({.successes = "1111"}, rows);
  add_episodes({.perturbation = "level_1_waits", .successes = "0011"}, rows);
  add_episodes({.perturbation = "level_2_moves", .successes = "0001"}, rows);
  add_episodes({.perturbation = "level_3_pushed", .successes = "1110"}, rows);
  add_episodes({.policy = "replay", .successes = "0001"}, rows);
  add_episodes({.policy = "replay", .perturbation = "level_1_waits", .successes = "1111"}, rows);
  add_episodes({.policy = "null", .arm = "null", .successes = "0000"}, rows);
  add_episodes({.perturbation = "push", .successes = "0000"}, rows);  // on no level
  return rows;
}

TEST(LevelTable, AScoreSaysWhereItEnds) {
  const std::vector<LevelTable> tables = level_tables(ladder());
  ASSERT_EQ(tables.size(), 1U);
  const LevelTable& table = tables[0];
  EXPECT_EQ(table.levels, (std::vector<LevelName>{{0, "clean"}, {1, "waits"}, {2, "moves"}, {3, "pushed"}}));
  ASSERT_EQ(table.entries.size(), 2U);  // the null arm has none
  const LevelEntry& dstar = table.entries[0];
  EXPECT_EQ(dstar.key.policy, "dstar");
  EXPECT_EQ(dstar.levels[1].k, 2);
  EXPECT_EQ(dstar.reached, 1);  // a half is enough; what comes after a level that was failed does not count
  EXPECT_DOUBLE_EQ(dstar.mean, (1.0 + 0.5 + 0.25 + 0.75) / 4.0);
  const LevelEntry& replay = table.entries[1];
  EXPECT_FALSE(replay.reached.has_value());
  EXPECT_EQ(replay.levels[2].n, 0);
  EXPECT_DOUBLE_EQ(replay.mean, 0.625);  // of the levels that were run
}

// A push while the arms move is of the push's stage, whatever the arms do.
TEST(LevelTable, ARowIsOfTheHigherOfItsPerturbationAndItsClip) {
  std::vector<EpisodeRow> rows;
  const auto add = [&](const std::string& clip, const std::string& perturbation, const std::string& successes) {
    const std::size_t first = rows.size();
    add_episodes({.policy = "velocity", .perturbation = perturbation, .successes = successes}, rows);
    for (std::size_t i = first; i < rows.size(); ++i) {
      rows[i].clip = clip;
      rows[i].key = episode_key(rows[i]);
    }
  };
  add("stage_1_own-stand", "clean", "11");
  add("stage_1_own-forward", "clean", "10");
  add("stage_2_moving-stand", "clean", "11");
  add("stage_1_own-stand", "stage_3_pushed", "01");
  add("stage_2_moving-stand", "stage_3_pushed", "00");
  add("stage_2_moving-stand", "kick", "11");  // on no stage
  const std::vector<LevelTable> tables = level_tables(rows);
  ASSERT_EQ(tables.size(), 1U);
  EXPECT_EQ(tables[0].ladder.word, "stage");
  const std::vector<Rate>& rates = tables[0].entries.at(0).levels;
  ASSERT_EQ(rates.size(), 3U);
  EXPECT_EQ(rates[0].n, 4);
  EXPECT_EQ(rates[0].k, 3);
  EXPECT_EQ(rates[1].n, 2);
  EXPECT_EQ(rates[2].n, 4);
  EXPECT_EQ(rates[2].k, 1);
  EXPECT_FALSE(tables[0].entries[0].reached.has_value());  // 75 % of the first stage is not 95 %
}

TEST(LevelTable, WhoStandsWhereItShouldWalkDoesNotPass) {
  std::vector<EpisodeRow> rows;
  add_episodes({.policy = "velocity", .perturbation = "stage_1_own", .successes = "1110"}, rows);
  add_episodes({.policy = "velocity", .perturbation = "stage_2_held", .successes = "1"}, rows);
  rows[4].metrics = {{"command_forward", 0.0}, {"speed_forward", -0.001}};  // nobody asked it to walk
  for (const auto& [row, speed] : {std::pair(0, 0.3), std::pair(1, 0.15), std::pair(2, 0.14), std::pair(3, 0.3)}) {
    rows[row].metrics["command_forward"] = 0.3;
    rows[row].metrics["speed_forward"] = speed;
  }
  const LevelEntry entry = level_tables(rows).at(0).entries.at(0);
  EXPECT_EQ(entry.levels.at(0).k, 2);
  EXPECT_EQ(entry.levels.at(1).k, 1);
}

TEST(LevelTable, RowsWithoutLevelsAreNoTable) {
  std::vector<EpisodeRow> rows;
  add_episodes({.successes = "11"}, rows);
  add_episodes({.perturbation = "push", .successes = "01"}, rows);
  EXPECT_TRUE(level_tables(rows).empty());
  EXPECT_TRUE(level_analysis({}).empty());
}

TEST(LevelTable, TwoNamesOfOneLevelAreRefused) {
  std::vector<EpisodeRow> rows = ladder();
  add_episodes({.perturbation = "level_1_hurries", .successes = "1"}, rows);
  EXPECT_THAT(test::thrown_message<InputError>([&] { level_tables(rows); }),
              AllOf(HasSubstr("two names of level 1"), HasSubstr("hurries"), HasSubstr("waits")));
}

TEST(LevelTable, SaysWhatWasReached) {
  const Analysis analysis = level_analysis(level_tables(ladder()));
  EXPECT_THAT(analysis_markdown(analysis),
              AllOf(HasSubstr("### Levels"), HasSubstr(" 1 waits |"), HasSubstr("25.0 [2.7, 80.2]"),
                    HasSubstr("up to which success is 50 % or more"), HasSubstr("|    none |")));
  const auto reached = figures_like(analysis, {.of = "level", .name = "reached"});
  ASSERT_EQ(reached.size(), 1U);  // the other policy reaches none
  EXPECT_EQ(reached[0].policy, "dstar");
  EXPECT_EQ(reached[0].value, 1.0);
  EXPECT_EQ(figure(analysis, {.of = "level", .name = "pass"}).value, 0.5);
  const Figure waits = figure(analysis, {.policy = "dstar", .of = "level_1_waits", .name = "success"});
  EXPECT_EQ(waits.n, 4);
}

}  // namespace
}  // namespace duet
