#include "duet/rows/episode_row.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>

#include "duet/core/arm_role.h"
#include "duet/core/digest.h"
#include "duet/core/names.h"
#include "duet/core/require.h"
#include "duet/rows/json_fields.h"

namespace duet {
namespace {

void check_key(const EpisodeRow& row) {
  if (row.key.empty()) throw InputError("episode row: key 'key': expected a digest, found \"\"");
}

void check_arm(const EpisodeRow& row) {
  std::vector<std::string> known;
  for (const EpisodeArmInfo& arm : kEpisodeArms) known.emplace_back(arm.name);
  if (std::ranges::find(known, row.arm) == known.end())
    throw InputError(fmt::format("episode row: key 'arm': {}", unknown_name_message("arm", row.arm, known)));
}

using Row = EpisodeRow;

constexpr auto kRowFields = std::to_array<RowField>({
    {{"key", &Row::key,
      "SHA-256 over suite hash, detectors, task, clip, episode, arm, policy, policy digest, controller, controller "
      "digest, engine, perturbation, each as `<length>:<text>`; once per run; checked on reading"},
     {.scanned = true, .check = check_key}},
    {{"suite", &Row::suite, "name of the suite"}, {.scanned = true}},
    {{"suite_version", &Row::suite_version, "rows compare only within one name and version"}, {.scanned = true}},
    {{"suite_hash", &Row::suite_hash, "SHA-256 of the resolved suite"}, {.scanned = true, .tabled = false}},
    {{"task", &Row::task, "a name of `duet list tasks`"}, {.scanned = true}},
    {{"clip", &Row::clip, "id of the clip"}, {.scanned = true}},
    {{"episode", &Row::episode, "number from 0"}, {.scanned = true}},
    {{"seed", &Row::seed, "what all randomness of the episode comes from"}},
    {{"engine", &Row::engine, "a name of `duet list engines`"}, {.scanned = true}},
    {{"engine_version", &Row::engine_version, "as the engine says it"}},
    {{"engine_profile", &Row::engine_profile, "`parity`, `fast`, ..."}, {.scanned = true}},
    {{"profile_digest", &Row::profile_digest,
      "SHA-256 of the engine's resolved profile. Not part of `key`: the suite hash covers what the profile says"},
     {.scanned = true, .tabled = false}},
    {{"controller", &Row::controller, "as the suite names it"}, {.scanned = true}},
    {{"controller_digest", &Row::controller_digest, "SHA-256 of what it is; empty where its files were not there"},
     {.scanned = true, .tabled = false}},
    {{"policy", &Row::policy, "as the suite names it"}, {.scanned = true}},
    {{"policy_digest", &Row::policy_digest, "SHA-256 of what it is; empty where its files were not there"},
     {.scanned = true, .tabled = false}},
    {{"perturbation", &Row::perturbation, "`clean` or the name of one in the suite"}, {.scanned = true}},
    {{"robot_digest", &Row::robot_digest,
      "SHA-256 of the robot model, the controller's own body; empty where the controller is absent"},
     {.scanned = true, .tabled = false}},
    {{"arm", &Row::arm,
      "`main`, `null` (a robot that stands still), `control` (a scripted policy that no score may reward), `shuffled` "
      "(a policy that sees the partner of another clip)"},
     {.scanned = true, .check = check_arm}},
    {{"outcome", &Row::outcome, "`ok`, `fell`, `diverged`, `timeout`, `unsupported`, `error`"}, {.scanned = true}},
    {{"message", &Row::message, "why, where the outcome is not `ok`; else empty"}},
    {{.name = "tags",
      .member = &Row::tags,
      .meaning = "what the suite says of the episode beside names, by name; absent where it says nothing "
                 "([Tags](../file-formats.md#tags))",
      .optional = true},
     {}},
    {{"detectors", &Row::detectors, "version of the detectors' code"}, {.scanned = true}},
    {{"success", &Row::success,
      "headline verdict; `null`: no detector ruled. Counted as success only where the outcome is `ok`"}},
    {{"verdicts", &Row::verdicts, "of every detector"}},
    {{"metrics", &Row::metrics,
      "names, units and directions: `duet list metrics`. `onset_s`: the first time from 1 s on at which a hand of the "
      "robot, in the pelvis frame, is 0.12 m from its median place over the first second, as a mean over the next 0.2 "
      "s, and stays there for 0.6 s (arms that swing with the steps do not); `partner_onset_s`: the same of the "
      "partner's wrists in the frame of its root",
      "", true}},
    {{"fell", &Row::fell, "at any time in the episode"}},
    {{"frames", &Row::frames, "recorded frames"}},
    {{"sim_s", &Row::sim_s, "simulated time", "s"}},
    {{"wall_s", &Row::wall_s, "real time", "s"}, {.repeats = false}},
    {{"contact_peak_n", &Row::contact_peak_n, "largest force of the human on the robot", "N"}},
    {{"contact_impulse_ns", &Row::contact_impulse_ns, "impulse of the human on the robot", "N s"}},
    {{"forces", &Row::forces,
      "contact forces by dotted name: `ground.mean_n`, `human.peak_n`, `human.chest.peak_n`, ... The ending is the "
      "unit: `_n` [N], `_ns` [N s], `_s` [s], `_n_cm2` [N/cm^2]; any other: a ratio or a flag",
      "", true}},
    {{"contacts", &Row::contacts,
      "contacts of one robot link with one capsule of a solid human, the 16 with the largest peak force, by begin"},
     {.tabled = false}},
    {{"contacts_total", &Row::contacts_total, "number of such contacts, those left out included"}},
    {{"trace", &Row::trace, "where a few points were"}, {.heavy = true, .tabled = false}},
    {{"feet", &Row::feet, "of a controller that walks, in an engine, the main arm: height of its soles"},
     {.heavy = true, .tabled = false}},
    {{"late_plans", &Row::late_plans, "ticks without a plan in time"}},
    {{"faults", &Row::faults, "of the controller"}},
    {{"policy_faults", &Row::policy_faults,
      "of the policy. A plan that fails is left out and the last one held; an episode whose policy is dead has the "
      "outcome `error`"},
     {.columns = "policy"}},
    {{"policy_ms", &Row::policy_ms, "wall time of a plan"}, {.repeats = false}},
    {{"state_hash", &Row::state_hash, "SHA-256 over the state trajectory; equal on the same program and machine"},
     {.scanned = true}},
    {{"started_at", &Row::started_at, "UTC, ISO 8601"}, {.scanned = true, .repeats = false, .tabled = false}},
});

void check_schema(JsonFields& fields) {
  const std::int64_t schema = fields.integer("schema");
  if (schema != kRowSchema)
    throw InputError(fmt::format("episode row: expected schema {}, found {}", kRowSchema, schema));
}

}  // namespace

std::span<const RowField> row_fields() { return kRowFields; }

std::string episode_key(const EpisodeRow& row) {
  const std::string episode = std::to_string(row.episode);
  std::string parts;
  for (const std::string* part :
       {&row.suite_hash, &row.detectors, &row.task, &row.clip, &episode, &row.arm, &row.policy, &row.policy_digest,
        &row.controller, &row.controller_digest, &row.engine, &row.perturbation}) {
    // The length first, so that no two different lists of parts read the same.
    parts += std::to_string(part->size());
    parts += ':';
    parts += *part;
  }
  return sha256_hex(parts);
}

nlohmann::json to_json(const EpisodeRow& row) {
  nlohmann::json json = {{"schema", kRowSchema}};
  for (const RowField& field : kRowFields) write_member(field.json, row, json);
  return json;
}

EpisodeRow row_from_json(const nlohmann::json& json) {
  JsonFields fields(json, "episode row");
  EpisodeRow row;
  check_schema(fields);
  for (const RowField& field : kRowFields) {
    read_member(field.json, fields, row);
    if (field.use.check != nullptr) field.use.check(row);
  }
  fields.refuse_unknown();
  return row;
}

}  // namespace duet
