#include "duet/rows/groups/database.h"

#include <gmock/gmock.h>
#include <sqlite3.h>

#include <filesystem>
#include <limits>
#include <memory>

#include "duet/core/require.h"
#include "duet/report/ranking/leaderboard.h"
#include "tests/rows/rows.h"
#include "tests/support.h"

namespace duet {
namespace {

using test::episode;
using test::full_row;
using test::ScratchFolder;
using test::thrown_message;
using testing::HasSubstr;

// The rows that a query gives, cells joined by '|', NULL as "NULL".
std::vector<std::string> query(const std::string& path, const char* sql) {
  sqlite3* opened = nullptr;
  EXPECT_EQ(sqlite3_open_v2(path.c_str(), &opened, SQLITE_OPEN_READONLY, nullptr), SQLITE_OK);
  const std::unique_ptr<sqlite3, decltype(&sqlite3_close)> database(opened, &sqlite3_close);
  std::vector<std::string> lines;
  const auto collect = [](void* out, int count, char** cells, char**) {
    std::string line;
    for (int i = 0; i < count; ++i) line.append(i == 0 ? "" : "|").append(cells[i] != nullptr ? cells[i] : "NULL");
    static_cast<std::vector<std::string>*>(out)->push_back(line);
    return 0;
  };
  EXPECT_EQ(sqlite3_exec(database.get(), sql, collect, &lines, nullptr), SQLITE_OK) << sqlite3_errmsg(database.get());
  return lines;
}

TEST(Database, HoldsEpisodesMetricsAndVerdicts) {
  const ScratchFolder scratch;
  EpisodeRow row = full_row();
  row.metrics["awd"] = std::numeric_limits<double>::quiet_NaN();
  row.contact_peak_n = std::numeric_limits<double>::infinity();
  const std::string path = scratch / "deep/results.sqlite";
  write_database({row, episode("replay", "hug", 1, false)}, path);
  EXPECT_THAT(query(path,
                    "SELECT task, clip, episode, seed, outcome, success, headline, fell, contact_peak_n, message "
                    "FROM episodes WHERE suite = 'hhoi-core'"),
              testing::ElementsAre("hug|hug-003|7|18364758544493064720|fell|1|0|1|NULL|" + row.message));
  EXPECT_THAT(query(path, "SELECT name FROM metrics ORDER BY name"), testing::ElementsAre("hf_ratio", "jpe"));
  EXPECT_THAT(query(path, "SELECT value = 0.1 + 0.2 FROM metrics WHERE name = 'jpe'"), testing::ElementsAre("1"));
  EXPECT_THAT(
      query(path, "SELECT engine_profile, substr(profile_digest, 1, 4) FROM episodes WHERE suite = 'hhoi-core'"),
      testing::ElementsAre("parity|dddd"));
  EXPECT_THAT(query(path,
                    "SELECT late_plans, faults_observations, faults_actions, faults_stopped FROM episodes "
                    "WHERE suite = 'hhoi-core'"),
              testing::ElementsAre("2|3|1|1"));
  EXPECT_THAT(query(path,
                    "SELECT policy_late, policy_invalid, policy_dead, policy_message, policy_ms_p50, policy_ms_max, "
                    "started_at FROM episodes WHERE suite = 'hhoi-core'"),
              testing::ElementsAre("4|1|1|the process ended|1.5|80.0|" + row.started_at));
  EXPECT_THAT(query(path, "SELECT name, value FROM forces ORDER BY name"),
              testing::ElementsAre("ground.mean_n|343.125", "human.chest.quasi_static_n|12.3"));
  EXPECT_THAT(query(path,
                    "SELECT number, link, region, capsule, begin_s, duration_s, peak_n, impulse_ns, depth_m, "
                    "windowed_mean_n, contacts_total FROM contacts JOIN episodes USING (key)"),
              testing::ElementsAre("0|left_wrist_yaw_link|chest|chest_left|1.25|0.3|81.5|3.25|0.00326|60.5|19"));
  EXPECT_THAT(query(path, "SELECT version, thresholds, success, frames FROM verdicts"),
              testing::ElementsAre("paper|strict|1|31"));
  EXPECT_THAT(
      query(path, "SELECT kind, name, value FROM verdict_values ORDER BY kind, name"),
      testing::ElementsAre("margin|overall|-0.25", "part|contact|1.0", "part|duration|0.0", "value|distance|0.1"));
}

TEST(Database, ColumnsOfAnEpisodeAreThoseOfTheFields) {
  const ScratchFolder scratch;
  write_database({full_row()}, scratch / "r.sqlite");
  std::vector<std::string> expected;
  for (const RowField& field : row_fields())
    for (const std::string& column : database_columns(field)) expected.push_back(column);
  EXPECT_EQ(query(scratch / "r.sqlite", "SELECT name FROM pragma_table_info('episodes') ORDER BY cid"), expected);
  EXPECT_THAT(query(scratch / "r.sqlite",
                    "SELECT name, type, \"notnull\", pk FROM pragma_table_info('episodes') WHERE name IN "
                    "('key', 'seed', 'episode', 'success', 'headline', 'sim_s', 'policy_dead') ORDER BY cid"),
              testing::ElementsAre("key|TEXT|0|1", "episode|INTEGER|1|0", "seed|TEXT|1|0", "success|INTEGER|0|0",
                                   "headline|INTEGER|1|0", "sim_s|REAL|0|0", "policy_dead|INTEGER|1|0"));
}

TEST(Database, AFieldIsAColumnAPartAColumnForEachMemberATraceNone) {
  const auto columns_of = [](std::string_view name) {
    for (const RowField& field : row_fields())
      if (field.name == name) return database_columns(field);
    return std::vector<std::string>{"no such field"};
  };
  EXPECT_THAT(columns_of("sim_s"), testing::ElementsAre("sim_s"));
  EXPECT_THAT(columns_of("success"), testing::ElementsAre("success", "headline"));
  EXPECT_THAT(columns_of("faults"), testing::ElementsAre("faults_observations", "faults_actions", "faults_stopped"));
  EXPECT_THAT(columns_of("policy_faults"),
              testing::ElementsAre("policy_late", "policy_invalid", "policy_dead", "policy_message"));
  for (const char* name : {"trace", "feet", "metrics", "forces", "contacts", "verdicts"})
    EXPECT_THAT(columns_of(name), testing::IsEmpty()) << name;
}

TEST(Database, ViewAgreesWithTheLeaderboard) {
  const ScratchFolder scratch;
  std::vector<EpisodeRow> rows;
  for (int i = 0; i < 12; ++i) rows.push_back(episode("replay", "hug", i, i < 7));
  rows[0].outcome = Outcome::kDiverged;
  rows[1].success.reset();
  rows[2].outcome = Outcome::kFell;
  const LeaderboardEntry entry = leaderboard(rows).front();
  write_database(rows, scratch / "r.sqlite");
  EXPECT_THAT(query(scratch / "r.sqlite", "SELECT n, k, fell, diverged FROM leaderboard"),
              testing::ElementsAre(std::to_string(entry.n) + "|" + std::to_string(entry.k) + "|1|1"));
  EXPECT_EQ(entry.k, 4);
}

TEST(Database, ReplacesTheFileAndLeavesNothingElse) {
  const ScratchFolder scratch;
  const std::string path = scratch / "r.sqlite";
  write_database({episode("replay", "hug", 0, true)}, path);
  write_database({episode("replay", "hug", 1, true), episode("replay", "hug", 2, true)}, path);
  EXPECT_THAT(query(path, "SELECT COUNT(*) FROM episodes"), testing::ElementsAre("2"));
  EXPECT_EQ(std::distance(std::filesystem::directory_iterator(scratch / ""), std::filesystem::directory_iterator()), 1);
}

TEST(Database, AFaultKeepsTheOldFile) {
  const ScratchFolder scratch;
  const std::string path = scratch / "r.sqlite";
  write_database({episode("replay", "hug", 0, true)}, path);
  const EpisodeRow twice = episode("replay", "hug", 1, true);
  EXPECT_THAT(thrown_message<InputError>([&] {
                write_database({twice, twice}, path);
              }),
              testing::AllOf(HasSubstr("cannot write '" + path + "'"), HasSubstr("episodes.key")));
  EXPECT_THAT(query(path, "SELECT episode FROM episodes"), testing::ElementsAre("0"));
  EXPECT_EQ(std::distance(std::filesystem::directory_iterator(scratch / ""), std::filesystem::directory_iterator()), 1);
  EXPECT_THAT(thrown_message<InputError>([] { write_database({}, "/proc/nowhere/r.sqlite"); }),
              HasSubstr("cannot write '/proc/nowhere/r.sqlite'"));
}

}  // namespace
}  // namespace duet
