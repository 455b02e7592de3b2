#include <gmock/gmock.h>

#include <cmath>

#include "duet/rows/row_file.h"
#include "tests/rows/rows.h"
#include "tests/support.h"

namespace duet {
namespace {

using test::full_row;
using testing::ElementsAre;
using testing::IsEmpty;

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

}  // namespace
}  // namespace duet
