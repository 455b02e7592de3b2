// The table of a row's fields: a new line in it is read, written, compared and scanned without another word.
#include <gmock/gmock.h>
#include <sqlite3.h>

#include <cmath>
#include <filesystem>
#include <limits>
#include <memory>
#include <set>

#include "duet/core/require.h"
#include "duet/report/ranking/leaderboard.h"
#include "duet/rows/episode_row.h"
#include "duet/rows/groups/database.h"
#include "duet/rows/json_fields.h"
#include "duet/rows/row_file.h"
#include "tests/rows/rows.h"
#include "tests/support.h"

namespace duet {
namespace {

using test::episode;
using test::full_row;
using test::ScratchFolder;
using test::thrown_message;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

std::vector<std::string> names_where(bool (*holds)(const RowFieldUse&)) {
  std::vector<std::string> names;
  for (const RowField& field : row_fields())
    if (holds(field.use)) names.emplace_back(field.name);
  return names;
}

// Another value than that of a new row, by type.
nlohmann::json another_value(const JsonDoc& doc) {
  static const std::map<std::string, nlohmann::json> kValues = {
      {"text", "shuffled"},  // an arm too
      {"integer", 7},
      {"integer, 64 bits", 0xfedcba9876543210ULL},
      {"number", 0.1 + 0.2},
      {"number or null", 0.1 + 0.2},
      {"true, false", true},
      {"true, false, null", false},
      {"name: number", {{"a", 0.5}}},
      {"name: number or null", {{"a", 0.5}}},
      {"name: true, false", {{"a", true}}},
      {"name: text", {{"a", "b"}}},
      {"list of texts", nlohmann::json::array({"root"})},
      {"list of integers", {1, 2, 3}},
      {"list of lists of integers", nlohmann::json::array({{1, 2, 3}})}};
  if (!doc.choices.empty()) return doc.choices.at(2);
  if (doc.members.empty()) return kValues.at(doc.type);
  nlohmann::json object = nlohmann::json::object();
  for (const JsonDoc& member : doc.members) object[member.name] = another_value(member);
  return doc.type == "list of objects" ? nlohmann::json::array({object}) : object;
}

EpisodeRow row_with_another(const RowField& field) {
  EpisodeRow row;
  row.key = "key";
  const nlohmann::json value = another_value(field);
  field.read(JsonNode(value, field.name), row);
  return row;
}

TEST(RowFields, EachStandsOnceWithAMeaning) {
  std::set<std::string> names;
  for (const RowField& field : row_fields()) {
    EXPECT_TRUE(names.insert(field.name).second) << field.name;
    EXPECT_FALSE(field.meaning.empty()) << field.name;
  }
}

TEST(RowFields, ARowIsItsFieldsAndItsSchema) {
  std::set<std::string> names = {"schema"}, written;
  for (const RowField& field : row_fields()) names.emplace(field.name);
  const nlohmann::json row = to_json(full_row());
  for (const auto& [key, value] : row.items()) written.insert(key);
  EXPECT_EQ(written, names);
}

TEST(RowFields, EachSurvivesTheWayThroughText) {
  for (const RowField& field : row_fields()) {
    EpisodeRow plain;
    plain.key = "key";
    if (field.optional) plain.tags = RowTags(Tags{{"a", "another"}});  // rows without tags are compared without them
    const EpisodeRow row = row_with_another(field);
    const std::string name(field.name);
    EXPECT_NE(to_json(row).at(name), to_json(plain).at(name)) << name;
    const EpisodeRow back = row_from_json(nlohmann::json::parse(dumped(to_json(row))));
    EXPECT_EQ(to_json(back), to_json(row)) << name;
    EXPECT_EQ(differing_fields(plain, back).empty(), !field.use.repeats) << name;
  }
}

TEST(RowFields, AScanHasThoseThatAreScannedAndNoOthers) {
  const nlohmann::json whole = to_json(full_row());
  const nlohmann::json scanned = to_json(scan_row(dumped(whole)).row);
  const nlohmann::json plain = to_json(EpisodeRow());
  for (const RowField& field : row_fields()) {
    const std::string name(field.name);
    const nlohmann::json wanted = field.use.scanned ? whole.at(name) : plain.value(name, nlohmann::json(nullptr));
    EXPECT_EQ(scanned.value(name, nlohmann::json(nullptr)), wanted) << name;
  }
}

TEST(RowFields, OnlyWallTimesDoNotRepeat) {
  EXPECT_THAT(names_where([](const RowFieldUse& use) { return !use.repeats; }),
              ElementsAre("wall_s", "policy_ms", "started_at"));
}

TEST(RowFields, OnlyTracesAreHeavy) {
  EXPECT_THAT(names_where([](const RowFieldUse& use) { return use.heavy; }), ElementsAre("trace", "feet"));
}

TEST(RowFields, TheListSaysTypeUnitColumnsAndMembers) {
  const std::vector<RowFieldInfo> list = row_field_list();
  const auto of = [&](const std::string& name) { return *std::ranges::find(list, name, &RowFieldInfo::name); };
  EXPECT_EQ(list.size(), row_fields().size() + 1);
  EXPECT_EQ(of("schema").type, "integer");
  EXPECT_EQ(of("sim_s").type, "number or null");
  EXPECT_EQ(of("sim_s").meaning, "simulated time [s]");
  EXPECT_EQ(of("wall_s").meaning, "real time [s]; differs from run to run");
  EXPECT_EQ(of("metrics").type, "name: number");
  EXPECT_EQ(of("success").type, "true, false, null");
  EXPECT_THAT(of("trace").meaning, testing::EndsWith("; null in published rows"));
  EXPECT_THAT(of("policy_ms").columns, ElementsAre("policy_ms_p50", "policy_ms_p95", "policy_ms_max"));
  ASSERT_EQ(of("verdicts").type, "list of objects");
  EXPECT_EQ(of("verdicts").members.front().name, "version");
  EXPECT_EQ(of("verdicts").members.back().type, "integer");
  EXPECT_EQ(of("contacts").members.back().meaning, "largest mean force over 0.1 s [N]");
}

TEST(RowIdentity, MishapsGiveWayToWhatEnded) {
  constexpr Outcome kEnded[] = {Outcome::kOk, Outcome::kFell, Outcome::kDiverged};
  for (const Outcome ended : kEnded) {
    for (const Outcome other : kEnded) EXPECT_EQ(which_stands(ended, other), Stands::kBothAgreed);
    for (const Outcome mishap : {Outcome::kError, Outcome::kTimedOut, Outcome::kUnsupported}) {
      EXPECT_EQ(which_stands(ended, mishap), Stands::kFirst);
      EXPECT_EQ(which_stands(mishap, ended), Stands::kSecond);
    }
  }
  EXPECT_EQ(which_stands(Outcome::kError, Outcome::kTimedOut), Stands::kSecond);
  EXPECT_EQ(which_stands(Outcome::kTimedOut, Outcome::kError), Stands::kFirst);
  for (const Outcome mishap : {Outcome::kError, Outcome::kTimedOut}) {
    EXPECT_EQ(which_stands(Outcome::kUnsupported, mishap), Stands::kFirst);
    EXPECT_EQ(which_stands(mishap, Outcome::kUnsupported), Stands::kSecond);
  }
  for (const Outcome mishap : {Outcome::kError, Outcome::kTimedOut, Outcome::kUnsupported})
    EXPECT_EQ(which_stands(mishap, mishap), Stands::kEither);
}

TEST(RowIdentity, RowsFromBeforeTagsEqualThoseWithThem) {
  EpisodeRow row = full_row();
  row.tags = {};
  EXPECT_THAT(differing_fields(full_row(), row), IsEmpty());
  EXPECT_THAT(differing_fields(row, full_row()), IsEmpty());
}

TEST(RowIdentity, WallTimesAreNoDifference) {
  EpisodeRow row = full_row();
  row.started_at = "2027-01-01T00:00:00Z";
  row.wall_s = 99.0;
  row.policy_ms = {.p50 = 9.0, .p95 = 9.0, .max = 9.0};
  EXPECT_THAT(differing_fields(full_row(), row), IsEmpty());
}

TEST(RowIdentity, EveryOtherFieldIsCompared) {
  const nlohmann::json json = to_json(full_row());
  for (const auto& [key, value] : json.items()) {
    if (key == "schema" || key == "started_at" || key == "wall_s" || key == "policy_ms") continue;
    nlohmann::json forged = json;
    if (value.is_string()) forged[key] = key == "arm" ? "main" : key == "outcome" ? "ok" : "another";
    if (value.is_boolean()) forged[key] = !value.get<bool>();
    if (value.is_number_integer()) forged[key] = 1U;
    if (value.is_number_float()) forged[key] = 0.5;
    if (value.is_array()) forged[key] = nlohmann::json::array();
    if (key == "metrics" || key == "forces") forged[key] = nlohmann::json::object();
    if (key == "tags") forged[key] = {{"perturbation.size", "60"}};
    if (key == "trace" || key == "feet") forged[key] = nullptr;
    if (key == "faults") forged[key]["actions"] = 7;
    if (key == "policy_faults") forged[key]["late"] = 7;
    const std::vector<std::string> differing = differing_fields(full_row(), row_from_json(forged));
    ASSERT_FALSE(differing.empty()) << key;
    for (const std::string& field : differing) EXPECT_TRUE(field.starts_with(key)) << key << ": " << field;
  }
}

TEST(RowIdentity, AFieldInsideAnotherIsNamedByItsPath) {
  EpisodeRow row = full_row();
  row.metrics["jpe"] = 0.25;
  row.verdicts[0].values["distance"] = 0.2;
  row.contacts[0].peak_n = 1.0;
  row.forces["new_n"] = 2.0;
  EXPECT_THAT(differing_fields(full_row(), row),
              ElementsAre("contacts.0.peak_n", "forces.new_n", "metrics.jpe", "verdicts.0.values.distance"));
}

TEST(RowIdentity, TheLastBitOfANumberCounts) {
  EpisodeRow row = full_row();
  row.metrics["jpe"] = std::nextafter(row.metrics["jpe"], 1.0);
  EXPECT_THAT(differing_fields(full_row(), row), ElementsAre("metrics.jpe"));
}

TEST(RowIdentity, NaNEqualsNaN) {
  EpisodeRow row = full_row();
  row.sim_s = std::nan("");
  EXPECT_THAT(differing_fields(row, row), IsEmpty());
  EXPECT_THAT(differing_fields(row, full_row()), ElementsAre("sim_s"));
}

TEST(RowIdentity, ARowReadBackEqualsItselfEvenWithATextThatIsNoUtf8) {
  EpisodeRow row = full_row();
  row.message = "engine said \xff";
  const std::string text = to_json(row).dump(-1, ' ', false, nlohmann::json::error_handler_t::replace);
  EXPECT_THAT(differing_fields(row, row_from_json(nlohmann::json::parse(text))), IsEmpty());
}

TEST(RowIdentity, TheTextNamesTheFirstFewWithBothValues) {
  EpisodeRow row = full_row();
  row.success = false;
  row.trace = {};
  row.metrics.clear();
  row.message = std::string(100, 'x');
  const std::vector<FieldDifference> differences = row_differences(full_row(), row);
  const std::string text = differences_text(differences);
  EXPECT_LT(text.find("success: "), text.find("metrics.jpe: "));
  EXPECT_SENTENCE(text);
  EXPECT_THAT(text, testing::HasSubstr("xxx..."));
  EXPECT_EQ(differences_text(std::vector<FieldDifference>(7, {"a", "1", "2"})),
            "a: 1, 2; a: 1, 2; a: 1, 2; a: 1, 2; a: 1, 2; 2 more");
}

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
