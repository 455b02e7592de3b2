#include "results/episode_row.h"

#include <gmock/gmock.h>

#include <cmath>
#include <limits>

#include "core/require.h"
#include "tests/results/rows.h"
#include "tests/support.h"

namespace duet {
namespace {

using test::full_row;
using test::thrown_message;
using testing::HasSubstr;

std::string refusal(const nlohmann::json& json) {
  return thrown_message<InputError>([&] { row_from_json(json); });
}

TEST(EpisodeRow, SurvivesTheWayThroughText) {
  const EpisodeRow row = full_row();
  const std::string text = to_json(row).dump();
  EXPECT_EQ(text.find('\n'), std::string::npos);
  const EpisodeRow back = row_from_json(nlohmann::json::parse(text));
  EXPECT_EQ(to_json(back), to_json(row));
  EXPECT_EQ(back.seed, row.seed);
  EXPECT_EQ(back.message, row.message);
  EXPECT_EQ(back.outcome, Outcome::kFell);
  EXPECT_EQ(back.success, std::optional(true));
  EXPECT_EQ(back.metrics, row.metrics);  // bit for bit
  ASSERT_EQ(back.verdicts.size(), 1U);
  EXPECT_EQ(back.verdicts[0].parts, row.verdicts[0].parts);
  EXPECT_EQ(back.verdicts[0].margins, row.verdicts[0].margins);
  EXPECT_EQ(back.verdicts[0].frames, 31);
  EXPECT_EQ(back.late_plans, 2);
  EXPECT_EQ(back.started_at, row.started_at);
}

TEST(EpisodeRow, NoVerdictIsNotFailure) {
  EpisodeRow row = full_row();
  row.success.reset();
  EXPECT_TRUE(to_json(row).at("success").is_null());
  EXPECT_FALSE(row_from_json(to_json(row)).success.has_value());
}

TEST(EpisodeRow, NumbersThatAreNotFiniteAreNeverWritten) {
  EpisodeRow row = full_row();
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const double infinity = std::numeric_limits<double>::infinity();
  row.metrics = {{"jpe", nan}, {"awd", -infinity}, {"lar", 0.5}};
  row.verdicts[0].values = {{"distance", infinity}, {"frames", 3.0}};
  row.verdicts[0].margins = {{"overall", nan}};
  row.contact_peak_n = infinity;
  row.wall_s = nan;
  const std::string text = to_json(row).dump();
  EXPECT_EQ(text.find("nan"), std::string::npos);
  EXPECT_EQ(text.find("inf"), std::string::npos);
  const EpisodeRow back = row_from_json(nlohmann::json::parse(text));
  EXPECT_EQ(back.metrics, (std::map<std::string, double>{{"lar", 0.5}}));
  EXPECT_TRUE(std::isnan(back.verdicts[0].values.at("distance")));
  EXPECT_EQ(back.verdicts[0].values.at("frames"), 3.0);
  EXPECT_TRUE(std::isnan(back.verdicts[0].margins.at("overall")));
  EXPECT_TRUE(std::isnan(back.contact_peak_n));
}

TEST(EpisodeRow, EveryKeyIsNeeded) {
  const nlohmann::json whole = to_json(full_row());
  for (const auto& [key, value] : whole.items()) {
    nlohmann::json json = whole;
    json.erase(key);
    EXPECT_EQ(refusal(json), "episode row: key '" + key + "' is missing");
  }
  for (const auto& [key, value] : whole.at("verdicts").at(0).items()) {
    nlohmann::json json = whole;
    json["verdicts"][0].erase(key);
    EXPECT_EQ(refusal(json), "episode row: verdict 0: key '" + key + "' is missing");
  }
}

TEST(EpisodeRow, EveryKeyHasItsType) {
  const nlohmann::json whole = to_json(full_row());
  for (const auto& [key, value] : whole.items()) {
    nlohmann::json json = whole;
    json[key] = nlohmann::json::array({1});
    EXPECT_THAT(refusal(json), HasSubstr("episode row")) << key;
  }
}

TEST(EpisodeRow, UnknownKeysAreRefusedWithTheNearest) {
  nlohmann::json json = to_json(full_row());
  json["enginee"] = "mujoco";
  EXPECT_THAT(refusal(json), HasSubstr("unknown key 'enginee': did you mean 'engine'?"));
  json = to_json(full_row());
  json["verdicts"][0]["sucess"] = true;
  EXPECT_THAT(refusal(json), HasSubstr("verdict 0: unknown key 'sucess'"));
}

TEST(EpisodeRow, WrongValuesAreNamed) {
  const auto with = [](const char* key, nlohmann::json value) {
    nlohmann::json json = to_json(full_row());
    json[key] = std::move(value);
    return refusal(json);
  };
  EXPECT_THAT(with("schema", 2), HasSubstr("expected schema 1, found 2"));
  EXPECT_THAT(with("key", ""), HasSubstr("key 'key'"));
  EXPECT_THAT(with("episode", -1), HasSubstr("key 'episode': expected a whole number of at least 0, found -1"));
  EXPECT_THAT(with("episode", 1.5), HasSubstr("key 'episode': expected a whole number, found 1.5"));
  EXPECT_THAT(with("seed", -3), HasSubstr("key 'seed'"));
  EXPECT_THAT(with("arm", "nul"), HasSubstr("unknown arm 'nul': did you mean 'null'?"));
  EXPECT_THAT(with("outcome", "exploded"), HasSubstr("key 'outcome'"));
  EXPECT_THAT(with("success", "yes"), HasSubstr("key 'success': expected true or false, found \"yes\""));
  EXPECT_THAT(with("metrics", {{"jpe", nullptr}}), HasSubstr("key 'metrics.jpe': expected a number, found null"));
  EXPECT_THAT(with("sim_s", "5"), HasSubstr("key 'sim_s': expected a number or null"));
  EXPECT_THAT(with("verdicts", {{"paper", 1}}), HasSubstr("expected a list, found object"));
  EXPECT_EQ(refusal(nlohmann::json::array()), "episode row: expected an object, found array");
}

TEST(EpisodeKey, IsOfWhatTheEpisodeIsAndOfNothingElse) {
  const EpisodeRow row = full_row();
  EXPECT_EQ(row.key.size(), 64U);
  for (std::string EpisodeRow::*field :
       {&EpisodeRow::suite_hash, &EpisodeRow::task, &EpisodeRow::clip, &EpisodeRow::policy, &EpisodeRow::controller,
        &EpisodeRow::engine, &EpisodeRow::perturbation}) {
    EpisodeRow other = row;
    other.*field += "x";
    EXPECT_NE(episode_key(other), row.key);
  }
  EpisodeRow other = row;
  other.episode = 8;
  EXPECT_NE(episode_key(other), row.key);
  other = row;
  other.success = false;
  other.wall_s = 9.0;
  other.key = "";
  EXPECT_EQ(episode_key(other), row.key);
}

TEST(EpisodeKey, PartsDoNotRunTogether) {
  EpisodeRow a = full_row();
  a.task = "hug";
  a.clip = "x";
  EpisodeRow b = full_row();
  b.task = "hu";
  b.clip = "gx";
  EXPECT_NE(episode_key(a), episode_key(b));
}

}  // namespace
}  // namespace duet
