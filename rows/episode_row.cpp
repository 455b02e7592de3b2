#include "duet/rows/episode_row.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <set>

#include "duet/core/digest.h"
#include "duet/core/named_table.h"
#include "duet/core/names.h"
#include "duet/core/require.h"
#include "duet/core/task.h"
#include "duet/rows/json_fields.h"

namespace duet {
template <>
const JsonSchema<Verdict>& json_schema<Verdict>() {
  using P = Verdict;
  static const JsonSchema<P> schema = {
      {{"version", "`paper` (as printed), `robot` (the performer's tracks are the robot's), `interaction` (the rule)"},
       &P::version},
      {{"thresholds", "`paper`, `strict`, `act`"}, &P::thresholds},
      {{"success", "whether the detector saw the act"}, &P::success},
      {{"parts", "conditions that hold or not"}, &P::parts},
      {{"values", "what the conditions are of; `duet list detectors` has names and units"}, &P::values},
      {{"margins", "of each condition; a positive one is satisfied"}, &P::margins},
      {{"frames", "number of evidence frames"}, &P::frames},
  };
  return schema;
}

template <>
const JsonSchema<StateTrace>& json_schema<StateTrace>() {
  using P = StateTrace;
  static const JsonSchema<P> schema = {
      {{.name = "rate_hz",
        .meaning = "frames a second; frame i is at i / rate_hz",
        .unit = "Hz",
        .range = {.low = 0.0, .with_low = false}},
       &P::rate_hz},
      {{"points", "`root`, `left_hand`, `right_hand`"}, &P::points},
      {{"mm", "one list per frame: x, y, z of each point in turn, frame W", "mm"}, &P::mm},
  };
  return schema;
}

template <>
const JsonSchema<ControllerFaults>& json_schema<ControllerFaults>() {
  using P = ControllerFaults;
  static const JsonSchema<P> schema = {
      {{"observations", "ticks on which the state or the reference was not finite"}, &P::observations},
      {{"actions", "ticks on which the command was not finite"}, &P::actions},
      {{"stopped", "whether it ended in its safe stop"}, &P::stopped},
  };
  return schema;
}

template <>
const JsonSchema<PolicyFaults>& json_schema<PolicyFaults>() {
  using P = PolicyFaults;
  static const JsonSchema<P> schema = {
      {{"late", "plans that did not come in time"}, &P::late},
      {{"invalid", "plans that could not be used: not finite, of the wrong size, not unit"}, &P::invalid},
      {{"dead", "whether it gave no plan any more; the outcome is then `error`"}, &P::dead},
      {{"message", "of the first fault"}, &P::message},
  };
  return schema;
}

template <>
const JsonSchema<PlanTimes>& json_schema<PlanTimes>() {
  using P = PlanTimes;
  static const JsonSchema<P> schema = {
      {{"p50", "median; null where no plan was asked for", "ms"}, &P::p50},
      {{"p95", "95th percentile", "ms"}, &P::p95},
      {{"max", "longest", "ms"}, &P::max},
  };
  return schema;
}

template <>
const JsonSchema<FootTrace>& json_schema<FootTrace>() {
  using P = FootTrace;
  static const JsonSchema<P> schema = {
      {{.name = "rate_hz",
        .meaning = "frames a second; frame i is at i / rate_hz",
        .unit = "Hz",
        .range = {.low = 0.0, .with_low = false}},
       &P::rate_hz},
      {{"left_mm", "height of the left sole's lowest point over the ground, one per frame", "mm"}, &P::left_mm},
      {{"right_mm", "likewise of the right sole", "mm"}, &P::right_mm},
  };
  return schema;
}

template <>
const JsonSchema<RowContact>& json_schema<RowContact>() {
  using P = RowContact;
  static const JsonSchema<P> schema = {
      {{"link", "name of the robot's link"}, &P::link},
      {{"region", "body region of the human"}, &P::region},
      {{"capsule", "name of the human's capsule"}, &P::capsule},
      {{"begin_s", "from the episode's begin", "s"}, &P::begin_s},
      {{"duration_s", "how long it lasted", "s"}, &P::duration_s},
      {{"peak_n", "largest force", "N"}, &P::peak_n},
      {{"impulse_ns", "of the force's magnitude", "N s"}, &P::impulse_ns},
      {{"depth_m", "largest depth", "m"}, &P::depth_m},
      {{"windowed_mean_n", "largest mean force over 0.1 s", "N"}, &P::windowed_mean_n},
  };
  return schema;
}

namespace {

void check_key(const EpisodeRow& row) {
  if (row.key.empty()) throw InputError("episode row: key 'key': expected a digest, found \"\"");
}

void check_arm(const EpisodeRow& row) {
  const std::vector<std::string> known = names_of(kEpisodeArms);
  if (std::ranges::find(known, row.arm) == known.end())
    throw InputError(fmt::format("episode row: key 'arm': {}", unknown_name_message("arm", row.arm, known)));
}

using Row = EpisodeRow;

std::vector<std::string> outcome_names() {
  std::vector<std::string> names;
  for (int i = 0; i <= static_cast<int>(Outcome::kError); ++i) names.emplace_back(to_string(static_cast<Outcome>(i)));
  return names;
}

JsonKey<Row> tags_key() {
  return {{.name = "tags",
           .meaning = "what the suite says of the episode beside names, by name; absent where it says nothing "
                      "([Tags](../file-formats.md#tags))",
           .optional = true},
          "name: text",
          [](const Row& row) { return nlohmann::json(row.tags.map()); },
          [](const JsonNode& node, Row& row) {
            Tags tags;
            read_json(node, {}, tags);
            row.tags = RowTags(std::move(tags));
          }};
}

// The fault of a trace, "" where it has none.
std::string fault_of(const StateTrace& trace) {
  if (trace.mm.empty()) return "key 'mm': expected at least one frame, found none";
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

bool is_empty(const StateTrace& trace) { return trace.mm.empty(); }
bool is_empty(const FootTrace& feet) { return feet.left_mm.empty() && feet.right_mm.empty(); }

// A trace, null where it is empty.
template <typename Trace>
JsonKey<Row> trace_key(const FieldDoc& words, Trace Row::*member) {
  const auto write = [words, member](const Row& row) {
    if (is_empty(row.*member)) return nlohmann::json();
    const std::string fault = fault_of(row.*member);
    require(fault.empty(), "episode row: {}: {}", words.name, fault);
    return json_mapping(row.*member);
  };
  const auto read = [member](const JsonNode& node, Row& row) {
    if (node.value().is_null()) return;
    row.*member = read_mapping<Trace>(node);
    if (const std::string fault = fault_of(row.*member); !fault.empty()) node.fail(fault);
  };
  JsonKey<Row> key(words, "object or null", write, read);
  key.members = json_members<Trace>();
  return key;
}

}  // namespace

const std::vector<RowField>& row_fields() {
  static const std::vector<RowField> fields = {
      {{"key",
        "SHA-256 over suite hash, detectors, task, clip, episode, arm, policy, policy digest, controller, controller "
        "digest, engine, perturbation, each as `<length>:<text>`; once per run; checked on reading"},
       &Row::key,
       {.scanned = true, .check = check_key}},
      {{"suite", "name of the suite"}, &Row::suite, {.scanned = true}},
      {{"suite_version", "rows compare only within one name and version"}, &Row::suite_version, {.scanned = true}},
      {{"suite_hash", "SHA-256 of the resolved suite"}, &Row::suite_hash, {.scanned = true, .tabled = false}},
      {{"task", "a name of `duet list tasks`"}, &Row::task, {.scanned = true}},
      {{"clip", "id of the clip"}, &Row::clip, {.scanned = true}},
      {{"episode", "number from 0"}, &Row::episode, {.scanned = true}},
      {{"seed", "what all randomness of the episode comes from"}, &Row::seed},
      {{"engine", "a name of `duet list engines`"}, &Row::engine, {.scanned = true}},
      {{"engine_version", "as the engine says it"}, &Row::engine_version},
      {{"engine_profile", "`parity`, `fast`, ..."}, &Row::engine_profile, {.scanned = true}},
      {{"profile_digest",
        "SHA-256 of the engine's resolved profile. Not part of `key`: the suite hash covers what the profile says"},
       &Row::profile_digest,
       {.scanned = true, .tabled = false}},
      {{"controller", "as the suite names it"}, &Row::controller, {.scanned = true}},
      {{"controller_digest", "SHA-256 of what it is; empty where its files were not there"},
       &Row::controller_digest,
       {.scanned = true, .tabled = false}},
      {{"policy", "as the suite names it"}, &Row::policy, {.scanned = true}},
      {{"policy_digest", "SHA-256 of what it is; empty where its files were not there"},
       &Row::policy_digest,
       {.scanned = true, .tabled = false}},
      {{"perturbation", "`clean` or the name of one in the suite"}, &Row::perturbation, {.scanned = true}},
      {{"robot_digest", "SHA-256 of the robot model, the controller's own body; empty where the controller is absent"},
       &Row::robot_digest,
       {.scanned = true, .tabled = false}},
      {{"arm",
        "`main`, `null` (a robot that stands still), `control` (a scripted policy that no score may reward), "
        "`shuffled` "
        "(a policy that sees the partner of another clip)"},
       &Row::arm,
       {.scanned = true, .check = check_arm}},
      {{.name = "outcome",
        .meaning = "`ok`, `fell`, `diverged`, `timeout`, `unsupported`, `error`",
        .choices = outcome_names()},
       &Row::outcome,
       {.scanned = true}},
      {{"message", "why, where the outcome is not `ok`; else empty"}, &Row::message},
      {tags_key(), &Row::tags},
      {{"detectors", "version of the detectors' code"}, &Row::detectors, {.scanned = true}},
      {{"success", "headline verdict; `null`: no detector ruled. Counted as success only where the outcome is `ok`"},
       &Row::success},
      {{"verdicts", "of every detector"}, &Row::verdicts},
      {{.name = "metrics",
        .meaning =
            "names, units and directions: `duet list metrics`. `onset_s`: the first time from 1 s on at which a hand "
            "of the "
            "robot, in the pelvis frame, is 0.12 m from its median place over the first second, as a mean over the "
            "next 0.2 "
            "s, and stays there for 0.6 s (arms that swing with the steps do not); `partner_onset_s`: the same of the "
            "partner's wrists in the frame of its root",
        .finite = true},
       &Row::metrics},
      {{"fell", "at any time in the episode"}, &Row::fell},
      {{"frames", "recorded frames"}, &Row::frames},
      {{"sim_s", "simulated time", "s"}, &Row::sim_s},
      {{"wall_s", "real time", "s"}, &Row::wall_s, {.repeats = false}},
      {{"contact_peak_n", "largest force of the human on the robot", "N"}, &Row::contact_peak_n},
      {{"contact_impulse_ns", "impulse of the human on the robot", "N s"}, &Row::contact_impulse_ns},
      {{.name = "forces",
        .meaning = "contact forces by dotted name: `ground.mean_n`, `human.peak_n`, `human.chest.peak_n`, ... The "
                   "ending is the "
                   "unit: `_n` [N], `_ns` [N s], `_s` [s], `_n_cm2` [N/cm^2]; any other: a ratio or a flag",
        .finite = true},
       &Row::forces},
      {{"contacts",
        "contacts of one robot link with one capsule of a solid human, the 16 with the largest peak force, by begin"},
       &Row::contacts,
       {.tabled = false}},
      {{"contacts_total", "number of such contacts, those left out included"}, &Row::contacts_total},
      {trace_key({"trace", "where a few points were"}, &Row::trace), &Row::trace, {.heavy = true, .tabled = false}},
      {trace_key({"feet", "of a controller that walks, in an engine, the main arm: height of its soles"}, &Row::feet),
       &Row::feet,
       {.heavy = true, .tabled = false}},
      {{"late_plans", "ticks without a plan in time"}, &Row::late_plans},
      {{"faults", "of the controller"}, &Row::faults},
      {{"policy_faults",
        "of the policy. A plan that fails is left out and the last one held; an episode whose policy is dead has the "
        "outcome `error`"},
       &Row::policy_faults,
       {.columns = "policy"}},
      {{"policy_ms", "wall time of a plan"}, &Row::policy_ms, {.repeats = false}},
      {{"state_hash", "SHA-256 over the state trajectory; equal on the same program and machine"},
       &Row::state_hash,
       {.scanned = true}},
      {{"started_at", "UTC, ISO 8601"}, &Row::started_at, {.scanned = true, .repeats = false, .tabled = false}},
  };
  return fields;
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
  for (const RowField& field : row_fields())
    if (nlohmann::json value = field.write(row); !field.optional || !value.empty()) json[field.name] = std::move(value);
  return json;
}

EpisodeRow row_from_json(const nlohmann::json& json) {
  const JsonNode node(json, "episode row");
  require_schema(node, kRowSchema);
  EpisodeRow row;
  read_mapping(node, row_fields(), row, "schema");
  for (const RowField& field : row_fields())
    if (field.use.check != nullptr) field.use.check(row);
  return row;
}

}  // namespace duet
