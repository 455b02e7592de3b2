// The table of a row's fields: a new line in it is read, written, compared and scanned without another word.
#include <gmock/gmock.h>

#include <set>

#include "duet/rows/episode_row.h"
#include "duet/rows/groups/database.h"
#include "duet/rows/json_fields.h"
#include "duet/rows/row_file.h"
#include "tests/rows/rows.h"
#include "tests/support.h"

namespace duet {
namespace {

using test::full_row;
using testing::ElementsAre;

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

}  // namespace
}  // namespace duet
