#include "duet/rows/episode_row.h"

#include <gmock/gmock.h>

#include <cmath>
#include <limits>

#include "duet/core/require.h"
#include "tests/rows/rows.h"
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
  EXPECT_EQ(back.engine_profile, "parity");
  EXPECT_EQ(back.policy_digest, row.policy_digest);
  EXPECT_EQ(back.controller_digest, row.controller_digest);
  EXPECT_EQ(back.detectors, "3");
  EXPECT_EQ(back.profile_digest, row.profile_digest);
  EXPECT_EQ(back.forces, row.forces);  // bit for bit
  ASSERT_EQ(back.contacts.size(), 1U);
  EXPECT_EQ(back.contacts[0].link, "left_wrist_yaw_link");
  EXPECT_EQ(back.contacts[0].region, "chest");
  EXPECT_EQ(back.contacts[0].capsule, "chest_left");
  EXPECT_EQ(back.contacts[0].begin_s, 1.25);
  EXPECT_EQ(back.contacts[0].duration_s, 0.1 + 0.2);
  EXPECT_EQ(back.contacts[0].peak_n, 81.5);
  EXPECT_EQ(back.contacts[0].impulse_ns, 3.25);
  EXPECT_EQ(back.contacts[0].depth_m, 0.00326);
  EXPECT_EQ(back.contacts[0].windowed_mean_n, 60.5);
  EXPECT_EQ(back.contacts_total, 19);
  EXPECT_EQ(back.trace.rate_hz, 12.5);
  EXPECT_EQ(back.trace.points, row.trace.points);
  EXPECT_EQ(back.trace.mm, row.trace.mm);
  EXPECT_EQ(back.feet.rate_hz, 25.0);
  EXPECT_EQ(back.feet.left_mm, row.feet.left_mm);
  EXPECT_EQ(back.feet.right_mm, row.feet.right_mm);
  EXPECT_EQ(back.faults.observations, 3);
  EXPECT_EQ(back.faults.actions, 1);
  EXPECT_TRUE(back.faults.stopped);
  EXPECT_EQ(back.policy_faults.late, 4);
  EXPECT_EQ(back.policy_faults.invalid, 1);
  EXPECT_TRUE(back.policy_faults.dead);
  EXPECT_EQ(back.policy_faults.message, "the process ended");
  EXPECT_EQ(back.policy_ms.p50, 1.5);
  EXPECT_EQ(back.policy_ms.p95, 0.1 + 0.2);
  EXPECT_EQ(back.policy_ms.max, 80.0);
}

TEST(EpisodeRow, OlderSchemasAreNotRead) {
  for (int schema = 1; schema <= 6; ++schema) {
    if (schema == kRowSchema) continue;
    nlohmann::json json = to_json(full_row());
    json["schema"] = schema;
    EXPECT_EQ(refusal(json), "episode row: expected schema 5, found " + std::to_string(schema));
  }
}

TEST(EpisodeRow, NoFieldMayBeAbsentButTags) {
  const nlohmann::json whole = to_json(full_row());
  nlohmann::json old = whole;
  old.erase("tags");
  EXPECT_TRUE(row_from_json(old).tags.empty());
  EXPECT_EQ(to_json(row_from_json(old)), old);  // a row from before there were any stays as it is
  for (const auto& [key, value] : old.items()) {
    nlohmann::json json = whole;
    json.erase(key);
    EXPECT_THAT(refusal(json), HasSubstr("expected the key '" + key + "', found none"));
  }
}

TEST(EpisodeRow, FaultsAndTimesOfPoliciesAreReadStrictly) {
  const auto with = [](const char* object, const char* key, nlohmann::json value) {
    nlohmann::json json = to_json(full_row());
    json[object][key] = std::move(value);
    return refusal(json);
  };
  EXPECT_SENTENCE(with("policy_faults", "late", -1));
  for (const char* text : {"dead", "message", "lat"}) EXPECT_SENTENCE(with("policy_faults", text, 1));
  EXPECT_SENTENCE(with("policy_ms", "max", "1"));
  EXPECT_SENTENCE(with("policy_ms", "p5", 1));
  EpisodeRow row = full_row();
  row.policy_ms = {};
  EXPECT_TRUE(to_json(row).at("policy_ms").at("max").is_null());
}

TEST(EpisodeRow, EveryArmIsRead) {
  for (const char* arm : {"main", "null", "shuffled"}) {
    EpisodeRow row = full_row();
    row.arm = arm;
    EXPECT_EQ(row_from_json(to_json(row)).arm, arm);
  }
}

TEST(EpisodeRow, FeetAndFaultsAreReadStrictly) {
  const auto with = [](const char* object, const char* key, nlohmann::json value) {
    nlohmann::json json = to_json(full_row());
    json[object][key] = std::move(value);
    return refusal(json);
  };
  EXPECT_SENTENCE(with("feet", "left_mm", {1, 2}));
  EXPECT_SENTENCE(with("feet", "right_mm", {1, 2, 0.5}));
  EXPECT_SENTENCE(with("feet", "rate_hz", 0));
  EXPECT_SENTENCE(with("feet", "left", 0));
  EXPECT_SENTENCE(with("faults", "actions", -1));
  EXPECT_SENTENCE(with("faults", "stopped", 1));
  EpisodeRow row = full_row();
  row.feet.left_mm.pop_back();
  EXPECT_SENTENCE(thrown_message<std::invalid_argument>([&] { to_json(row); }));
  row.feet = {};
  EXPECT_TRUE(to_json(row).at("feet").is_null());
}

TEST(EpisodeRow, ContactsAreReadStrictly) {
  const auto with = [](const char* key, nlohmann::json value) {
    nlohmann::json json = to_json(full_row());
    json["contacts"][0][key] = std::move(value);
    return refusal(json);
  };
  EXPECT_SENTENCE(with("peak_n", "81"));
  EXPECT_SENTENCE(with("link", 3));
  EXPECT_SENTENCE(with("peak", 3));
  const nlohmann::json whole = to_json(full_row());
  for (const auto& [key, value] : whole.at("contacts").at(0).items()) {
    nlohmann::json json = whole;
    json["contacts"][0].erase(key);
    EXPECT_EQ(refusal(json), "episode row: contacts[0]: expected the key '" + key + "', found none");
  }
}

TEST(EpisodeRow, ATraceWithoutFramesIsNull) {
  EpisodeRow row = full_row();
  row.trace.mm.clear();
  EXPECT_TRUE(to_json(row).at("trace").is_null());
  EXPECT_TRUE(row_from_json(to_json(row)).trace.mm.empty());
}

TEST(EpisodeRow, ATraceHasThreeWholeNumbersForEachPoint) {
  const auto with = [](const char* key, nlohmann::json value) {
    nlohmann::json json = to_json(full_row());
    json["trace"][key] = std::move(value);
    return refusal(json);
  };
  using Json = nlohmann::json;
  EXPECT_SENTENCE(with("mm", Json::array({{0, 0, 0, 0, 0, 0}, {1, 2, 3}})));
  EXPECT_SENTENCE(with("mm", Json::array({{0, 0, 0, 0, 0, 0.5}})));
  EXPECT_SENTENCE(with("mm", Json::array({{0, 0, 0, 0, 0, 3000000000}})));
  EXPECT_SENTENCE(with("mm", Json::array()));
  EXPECT_SENTENCE(with("mm", 3));
  EXPECT_SENTENCE(with("points", {"root", "root"}));
  EXPECT_SENTENCE(with("points", {"root", 1}));
  EXPECT_SENTENCE(with("rate_hz", 0));
  EXPECT_SENTENCE(with("rat_hz", 10));
  EpisodeRow row = full_row();
  row.trace.mm[1].pop_back();
  EXPECT_SENTENCE(thrown_message<std::invalid_argument>([&] { to_json(row); }));
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
  row.forces = {{"ground.peak_n", infinity}, {"ground.mean_n", 343.0}};
  row.contacts[0].peak_n = nan;
  row.contact_peak_n = infinity;
  row.wall_s = nan;
  const std::string text = to_json(row).dump();
  EXPECT_EQ(text.find("nan"), std::string::npos);
  EXPECT_EQ(text.find("inf"), std::string::npos);
  const EpisodeRow back = row_from_json(nlohmann::json::parse(text));
  EXPECT_EQ(back.metrics, (std::map<std::string, double>{{"lar", 0.5}}));
  EXPECT_EQ(back.forces, (std::map<std::string, double>{{"ground.mean_n", 343.0}}));
  EXPECT_TRUE(std::isnan(back.verdicts[0].values.at("distance")));
  EXPECT_EQ(back.verdicts[0].values.at("frames"), 3.0);
  EXPECT_TRUE(std::isnan(back.verdicts[0].margins.at("overall")));
  EXPECT_TRUE(std::isnan(back.contact_peak_n));
  EXPECT_TRUE(std::isnan(back.contacts[0].peak_n));
}

TEST(EpisodeRow, EveryKeyButContactsAndTagsIsNeeded) {
  const nlohmann::json whole = to_json(full_row());
  for (const auto& [key, value] : whole.items()) {
    if (key.starts_with("contacts") || key == "tags") continue;
    nlohmann::json json = whole;
    json.erase(key);
    EXPECT_EQ(refusal(json), "episode row: expected the key '" + key + "', found none");
  }
  for (const auto& [key, value] : whole.at("verdicts").at(0).items()) {
    nlohmann::json json = whole;
    json["verdicts"][0].erase(key);
    EXPECT_EQ(refusal(json), "episode row: verdicts[0]: expected the key '" + key + "', found none");
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
  EXPECT_SENTENCE(refusal(json));
  json = to_json(full_row());
  json["verdicts"][0]["sucess"] = true;
  EXPECT_SENTENCE(refusal(json));
}

TEST(EpisodeRow, WrongValuesAreNamed) {
  const auto with = [](const char* key, nlohmann::json value) {
    nlohmann::json json = to_json(full_row());
    json[key] = std::move(value);
    return refusal(json);
  };
  EXPECT_SENTENCE(with("schema", 4));
  EXPECT_SENTENCE(with("key", ""));
  EXPECT_SENTENCE(with("episode", -1));
  EXPECT_SENTENCE(with("episode", 1.5));
  EXPECT_SENTENCE(with("seed", -3));
  EXPECT_SENTENCE(with("arm", "nul"));
  EXPECT_SENTENCE(with("outcome", "exploded"));
  EXPECT_SENTENCE(with("success", "yes"));
  EXPECT_SENTENCE(with("metrics", {{"jpe", nullptr}}));
  EXPECT_SENTENCE(with("forces", {{"ground.peak_n", nullptr}}));
  EXPECT_SENTENCE(with("contacts", 2));
  EXPECT_SENTENCE(with("contacts_total", -1));
  EXPECT_SENTENCE(with("engine_profile", 2));
  EXPECT_SENTENCE(with("sim_s", "5"));
  EXPECT_SENTENCE(with("verdicts", {{"paper", 1}}));
  EXPECT_SENTENCE(refusal(nlohmann::json::array()));
}

TEST(EpisodeKey, IsOfWhatTheEpisodeIsAndOfNothingElse) {
  const EpisodeRow row = full_row();
  EXPECT_EQ(row.key.size(), 64U);
  for (std::string EpisodeRow::*field :
       {&EpisodeRow::suite_hash, &EpisodeRow::detectors, &EpisodeRow::task, &EpisodeRow::clip, &EpisodeRow::arm,
        &EpisodeRow::policy, &EpisodeRow::policy_digest, &EpisodeRow::controller, &EpisodeRow::controller_digest,
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
  other.engine_profile = "fast";  // the suite hash covers what it means
  other.profile_digest = std::string(64, 'e');
  other.forces.clear();
  other.key = "";
  EXPECT_EQ(episode_key(other), row.key);
}

TEST(EpisodeKey, PartsDoNotRunTogether) {
  const auto key_of = [](const std::string& task, const std::string& clip) {
    EpisodeRow row = full_row();
    row.task = task;
    row.clip = clip;
    return episode_key(row);
  };
  EXPECT_NE(key_of("hug", "x"), key_of("hu", "gx"));
}

}  // namespace
}  // namespace duet
