#include "duet/rows/episode_row.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <set>

#include "duet/core/digest.h"
#include "duet/core/names.h"
#include "duet/core/require.h"
#include "duet/core/task.h"
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

namespace {

constexpr auto kVerdictMembers = std::to_array<JsonMember<Verdict>>({
    {"version", &Verdict::version,
     "`paper` (as printed), `robot` (the performer's tracks are the robot's), `interaction` (the rule)"},
    {"thresholds", &Verdict::thresholds, "`paper`, `strict`, `act`"},
    {"success", &Verdict::success, "whether the detector saw the act"},
    {"parts", &Verdict::parts, "conditions that hold or not"},
    {"values", &Verdict::values, "what the conditions are of; `duet list detectors` has names and units"},
    {"margins", &Verdict::margins, "of each condition; a positive one is satisfied"},
    {"frames", &Verdict::frames, "number of evidence frames"},
});

constexpr auto kTraceMembers = std::to_array<JsonMember<StateTrace>>({
    {"rate_hz", &StateTrace::rate_hz, "frames a second; frame i is at i / rate_hz", "Hz", true},
    {"points", &StateTrace::points, "`root`, `left_hand`, `right_hand`"},
    {"mm", &StateTrace::mm, "one list per frame: x, y, z of each point in turn, frame W", "mm"},
});

constexpr auto kFaultMembers = std::to_array<JsonMember<ControllerFaults>>({
    {"observations", &ControllerFaults::observations, "ticks on which the state or the reference was not finite"},
    {"actions", &ControllerFaults::actions, "ticks on which the command was not finite"},
    {"stopped", &ControllerFaults::stopped, "whether it ended in its safe stop"},
});

constexpr auto kPolicyFaultMembers = std::to_array<JsonMember<PolicyFaults>>({
    {"late", &PolicyFaults::late, "plans that did not come in time"},
    {"invalid", &PolicyFaults::invalid, "plans that could not be used: not finite, of the wrong size, not unit"},
    {"dead", &PolicyFaults::dead, "whether it gave no plan any more; the outcome is then `error`"},
    {"message", &PolicyFaults::message, "of the first fault"},
});

constexpr auto kPolicyTimeMembers = std::to_array<JsonMember<PlanTimes>>({
    {"p50", &PlanTimes::p50, "median; null where no plan was asked for", "ms"},
    {"p95", &PlanTimes::p95, "95th percentile", "ms"},
    {"max", &PlanTimes::max, "longest", "ms"},
});

constexpr auto kFootMembers = std::to_array<JsonMember<FootTrace>>({
    {"rate_hz", &FootTrace::rate_hz, "frames a second; frame i is at i / rate_hz", "Hz", true},
    {"left_mm", &FootTrace::left_mm, "height of the left sole's lowest point over the ground, one per frame", "mm"},
    {"right_mm", &FootTrace::right_mm, "likewise of the right sole", "mm"},
});

constexpr auto kContactMembers = std::to_array<JsonMember<RowContact>>({
    {"link", &RowContact::link, "name of the robot's link"},
    {"region", &RowContact::region, "body region of the human"},
    {"capsule", &RowContact::capsule, "name of the human's capsule"},
    {"begin_s", &RowContact::begin_s, "from the episode's begin", "s"},
    {"duration_s", &RowContact::duration_s, "how long it lasted", "s"},
    {"peak_n", &RowContact::peak_n, "largest force", "N"},
    {"impulse_ns", &RowContact::impulse_ns, "of the force's magnitude", "N s"},
    {"depth_m", &RowContact::depth_m, "largest depth", "m"},
    {"windowed_mean_n", &RowContact::windowed_mean_n, "largest mean force over 0.1 s", "N"},
});

// The fault of a trace, "" where it has none.
std::string fault_of(const StateTrace& trace) {
  if (trace.mm.empty()) return "";
  if (!std::isfinite(trace.rate_hz) || trace.rate_hz <= 0.0)
    return fmt::format("key 'rate_hz': expected a number above 0, found {}", trace.rate_hz);
  const std::set<std::string> distinct(trace.points.begin(), trace.points.end());
  if (trace.points.empty() || distinct.size() != trace.points.size())
    return "key 'points': expected at least one name, each once";
  for (std::size_t frame = 0; frame < trace.mm.size(); ++frame) {
    if (trace.mm[frame].size() == 3 * trace.points.size()) continue;
    return fmt::format("key 'mm': frame {}: expected {} whole numbers (3 for each of {} points), found {}", frame,
                       3 * trace.points.size(), trace.points.size(), trace.mm[frame].size());
  }
  return "";
}

// The fault of a foot trace, "" where it has none.
std::string fault_of(const FootTrace& feet) {
  if (!std::isfinite(feet.rate_hz) || feet.rate_hz <= 0.0)
    return fmt::format("key 'rate_hz': expected a number above 0, found {}", feet.rate_hz);
  if (feet.left_mm.size() == feet.right_mm.size()) return "";
  return fmt::format("expected as many heights of both feet, found {} of the left and {} of the right",
                     feet.left_mm.size(), feet.right_mm.size());
}

template <typename Trace>
void read_trace(JsonFields& fields, const std::string& key, Trace& trace) {
  if (fields.at(key).is_null()) return;
  const std::string what = fields.what() + ": " + key;
  trace = part_from_json<Trace>(fields.at(key), what);
  if (const std::string fault = fault_of(trace); !fault.empty()) throw InputError(what + ": " + fault);
}

}  // namespace

template <>
std::span<const JsonMember<Verdict>> part_members<Verdict>() {
  return kVerdictMembers;
}
template <>
std::span<const JsonMember<StateTrace>> part_members<StateTrace>() {
  return kTraceMembers;
}
template <>
std::span<const JsonMember<ControllerFaults>> part_members<ControllerFaults>() {
  return kFaultMembers;
}
template <>
std::span<const JsonMember<PolicyFaults>> part_members<PolicyFaults>() {
  return kPolicyFaultMembers;
}
template <>
std::span<const JsonMember<PlanTimes>> part_members<PlanTimes>() {
  return kPolicyTimeMembers;
}
template <>
std::span<const JsonMember<FootTrace>> part_members<FootTrace>() {
  return kFootMembers;
}
template <>
std::span<const JsonMember<RowContact>> part_members<RowContact>() {
  return kContactMembers;
}

const Tags& RowTags::map() const {
  static const Tags none;
  return tags_ ? *tags_ : none;
}

const std::string& RowTags::text(std::string_view name) const {
  static const std::string none;
  const auto found = map().find(name);
  return found == map().end() ? none : found->second;
}

double RowTags::number(std::string_view name) const {
  return parse_number(text(name)).value_or(std::numeric_limits<double>::quiet_NaN());
}

nlohmann::json json_value(const RowTags& tags, bool) { return tags.map(); }
void read_value(JsonFields& fields, const std::string& key, bool, RowTags& tags) { tags = RowTags(fields.texts(key)); }
std::string_view value_words(ValueType<RowTags>, bool) { return "name: text"; }

nlohmann::json json_value(const StateTrace& trace, bool) {
  const std::string fault = fault_of(trace);
  require(fault.empty(), "episode row: trace: " + fault);
  return trace.mm.empty() ? nlohmann::json(nullptr) : part_json(trace);
}
nlohmann::json json_value(const FootTrace& feet, bool) {
  if (feet.left_mm.empty() && feet.right_mm.empty()) return nullptr;
  const std::string fault = fault_of(feet);
  require(fault.empty(), "episode row: feet: " + fault);
  return part_json(feet);
}
void read_value(JsonFields& fields, const std::string& key, bool, StateTrace& trace) { read_trace(fields, key, trace); }
void read_value(JsonFields& fields, const std::string& key, bool, FootTrace& feet) { read_trace(fields, key, feet); }
std::string_view value_words(ValueType<StateTrace>, bool) { return "object or null"; }
std::string_view value_words(ValueType<FootTrace>, bool) { return "object or null"; }

}  // namespace duet
