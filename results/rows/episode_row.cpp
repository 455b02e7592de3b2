#include "duet/results/rows/episode_row.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <set>

#include "duet/core/digest.h"
#include "duet/core/names.h"
#include "duet/core/require.h"
#include "duet/results/rows/json_fields.h"

namespace duet {
namespace {

nlohmann::json finite_or_null(const std::map<std::string, double>& values) {
  nlohmann::json json = nlohmann::json::object();
  for (const auto& [name, value] : values) json[name] = number_or_null(value);
  return json;
}

nlohmann::json finite_only(const std::map<std::string, double>& values) {
  nlohmann::json json = nlohmann::json::object();
  for (const auto& [name, value] : values) {
    if (std::isfinite(value)) json[name] = value;
  }
  return json;
}

nlohmann::json to_json(const Verdict& verdict) {
  return {{"version", verdict.version},
          {"thresholds", verdict.thresholds},
          {"success", verdict.success},
          {"parts", verdict.parts},
          {"values", finite_or_null(verdict.values)},
          {"margins", finite_or_null(verdict.margins)},
          {"frames", verdict.frames}};
}

nlohmann::json to_json(const RowContact& contact) {
  return {{"link", contact.link},
          {"region", contact.region},
          {"capsule", contact.capsule},
          {"begin_s", number_or_null(contact.begin_s)},
          {"duration_s", number_or_null(contact.duration_s)},
          {"peak_n", number_or_null(contact.peak_n)},
          {"impulse_ns", number_or_null(contact.impulse_ns)},
          {"depth_m", number_or_null(contact.depth_m)},
          {"windowed_mean_n", number_or_null(contact.windowed_mean_n)}};
}

template <typename T>
nlohmann::json list_json(const std::vector<T>& items) {
  nlohmann::json list = nlohmann::json::array();
  for (const T& item : items) list.push_back(to_json(item));
  return list;
}

int small_integer(JsonFields& fields, const std::string& key, const std::string& what) {
  const std::int64_t value = fields.integer(key);
  if (value < 0 || value > std::numeric_limits<int>::max()) {
    throw InputError(fmt::format("{}: key '{}': expected a whole number of at least 0, found {}", what, key, value));
  }
  return static_cast<int>(value);
}

Verdict verdict_from_json(const nlohmann::json& json, const std::string& what) {
  JsonFields fields(json, what);
  Verdict verdict;
  verdict.version = fields.text("version");
  verdict.thresholds = fields.text("thresholds");
  verdict.success = fields.boolean("success");
  verdict.parts = fields.booleans("parts");
  verdict.values = fields.numbers("values", true);
  verdict.margins = fields.numbers("margins", true);
  verdict.frames = small_integer(fields, "frames", what);
  fields.refuse_unknown();
  return verdict;
}

RowContact contact_from_json(const nlohmann::json& json, const std::string& what) {
  JsonFields fields(json, what);
  RowContact contact;
  contact.link = fields.text("link");
  contact.region = fields.text("region");
  contact.capsule = fields.text("capsule");
  contact.begin_s = fields.number_or_nan("begin_s");
  contact.duration_s = fields.number_or_nan("duration_s");
  contact.peak_n = fields.number_or_nan("peak_n");
  contact.impulse_ns = fields.number_or_nan("impulse_ns");
  contact.depth_m = fields.number_or_nan("depth_m");
  contact.windowed_mean_n = fields.number_or_nan("windowed_mean_n");
  fields.refuse_unknown();
  return contact;
}

// `what`: one item, "verdict".
template <typename T>
std::vector<T> items_from_json(const nlohmann::json& json, const std::string& key, const char* what,
                               T (*item_from_json)(const nlohmann::json&, const std::string&)) {
  if (!json.is_array()) {
    throw InputError(fmt::format("episode row: key '{}': expected a list, found {}", key, json.type_name()));
  }
  std::vector<T> items;
  for (const nlohmann::json& entry : json) {
    items.push_back(item_from_json(entry, fmt::format("episode row: {} {}", what, items.size())));
  }
  return items;
}

Outcome outcome_from(const std::string& name) {
  try {
    return parse_outcome(name);
  } catch (const std::invalid_argument& error) {
    throw InputError(fmt::format("episode row: key 'outcome': {}", error.what()));
  }
}

std::string arm_from(const std::string& name) {
  const std::array<std::string, 3> known = {"main", "null", "shuffled"};
  if (std::find(known.begin(), known.end(), name) != known.end()) return name;
  throw InputError(fmt::format("episode row: key 'arm': {}", unknown_name_message("arm", name, known)));
}

// What is wrong with a trace, "" where nothing is.
std::string fault_of(const StateTrace& trace) {
  if (trace.mm.empty()) return "";
  if (!std::isfinite(trace.rate_hz) || trace.rate_hz <= 0.0) {
    return fmt::format("key 'rate_hz': expected a number above 0, found {}", trace.rate_hz);
  }
  const std::set<std::string> distinct(trace.points.begin(), trace.points.end());
  if (trace.points.empty() || distinct.size() != trace.points.size()) {
    return "key 'points': expected at least one name, each once";
  }
  for (std::size_t frame = 0; frame < trace.mm.size(); ++frame) {
    if (trace.mm[frame].size() == 3 * trace.points.size()) continue;
    return fmt::format("key 'mm': frame {}: expected {} whole numbers (3 for each of {} points), found {}", frame,
                       3 * trace.points.size(), trace.points.size(), trace.mm[frame].size());
  }
  return "";
}

nlohmann::json to_json(const StateTrace& trace) {
  const std::string fault = fault_of(trace);
  require(fault.empty(), "episode row: trace: " + fault);
  if (trace.mm.empty()) return nullptr;
  return {{"rate_hz", trace.rate_hz}, {"points", trace.points}, {"mm", trace.mm}};
}

// A list of T that nlohmann would convert without a word from other types.
template <typename T, typename Holds>
std::vector<T> list_of(const nlohmann::json& json, const std::string& where, const char* expected, Holds holds) {
  if (!json.is_array() || !std::all_of(json.begin(), json.end(), holds)) {
    throw InputError(fmt::format("episode row: {}: expected a list of {}", where, expected));
  }
  return json.get<std::vector<T>>();
}

bool is_small_integer(const nlohmann::json& json) {
  if (!json.is_number_integer()) return false;
  const auto value = json.get<double>();
  return std::abs(value) <= std::numeric_limits<int>::max();
}

StateTrace trace_from_json(const nlohmann::json& json) {
  StateTrace trace;
  if (json.is_null()) return trace;
  JsonFields fields(json, "episode row: trace");
  trace.rate_hz = fields.number("rate_hz");
  trace.points = list_of<std::string>(fields.at("points"), "trace: key 'points'", "names",
                                      [](const nlohmann::json& name) { return name.is_string(); });
  const nlohmann::json& frames = fields.at("mm");
  if (!frames.is_array() || frames.empty()) throw InputError("episode row: trace: key 'mm': expected a list of frames");
  for (const nlohmann::json& frame : frames) {
    const std::string where = fmt::format("trace: key 'mm': frame {}", trace.mm.size());
    trace.mm.push_back(list_of<int>(frame, where, "whole numbers of 32 bits", is_small_integer));
  }
  fields.refuse_unknown();
  if (const std::string fault = fault_of(trace); !fault.empty()) throw InputError("episode row: trace: " + fault);
  return trace;
}

// What is wrong with a foot trace, "" where nothing is.
std::string fault_of(const FootTrace& feet) {
  if (!std::isfinite(feet.rate_hz) || feet.rate_hz <= 0.0) {
    return fmt::format("key 'rate_hz': expected a number above 0, found {}", feet.rate_hz);
  }
  if (feet.left_mm.size() == feet.right_mm.size()) return "";
  return fmt::format("expected as many heights of both feet, found {} of the left and {} of the right",
                     feet.left_mm.size(), feet.right_mm.size());
}

nlohmann::json to_json(const FootTrace& feet) {
  if (feet.left_mm.empty() && feet.right_mm.empty()) return nullptr;
  const std::string fault = fault_of(feet);
  require(fault.empty(), "episode row: feet: " + fault);
  return {{"rate_hz", feet.rate_hz}, {"left_mm", feet.left_mm}, {"right_mm", feet.right_mm}};
}

FootTrace feet_from_json(const nlohmann::json& json) {
  FootTrace feet;
  if (json.is_null()) return feet;
  JsonFields fields(json, "episode row: feet");
  feet.rate_hz = fields.number("rate_hz");
  const auto heights = [&](const char* key) {
    return list_of<int>(fields.at(key), fmt::format("feet: key '{}'", key), "whole numbers of 32 bits",
                        is_small_integer);
  };
  feet.left_mm = heights("left_mm");
  feet.right_mm = heights("right_mm");
  fields.refuse_unknown();
  if (const std::string fault = fault_of(feet); !fault.empty()) throw InputError("episode row: feet: " + fault);
  return feet;
}

nlohmann::json to_json(const RowFaults& faults) {
  return {{"observations", faults.observations}, {"actions", faults.actions}, {"stopped", faults.stopped}};
}

RowFaults faults_from_json(const nlohmann::json& json) {
  const char* what = "episode row: faults";
  JsonFields fields(json, what);
  RowFaults faults;
  faults.observations = small_integer(fields, "observations", what);
  faults.actions = small_integer(fields, "actions", what);
  faults.stopped = fields.boolean("stopped");
  fields.refuse_unknown();
  return faults;
}

nlohmann::json to_json(const RowPolicyFaults& faults) {
  return {{"late", faults.late}, {"invalid", faults.invalid}, {"dead", faults.dead}, {"message", faults.message}};
}

RowPolicyFaults policy_faults_from_json(const nlohmann::json& json) {
  const char* what = "episode row: policy_faults";
  JsonFields fields(json, what);
  RowPolicyFaults faults;
  faults.late = small_integer(fields, "late", what);
  faults.invalid = small_integer(fields, "invalid", what);
  faults.dead = fields.boolean("dead");
  faults.message = fields.text("message");
  fields.refuse_unknown();
  return faults;
}

nlohmann::json to_json(const RowPolicyTime& time) {
  return {{"p50", number_or_null(time.p50)}, {"p95", number_or_null(time.p95)}, {"max", number_or_null(time.max)}};
}

RowPolicyTime policy_time_from_json(const nlohmann::json& json) {
  JsonFields fields(json, "episode row: policy_ms");
  const RowPolicyTime time = {fields.number_or_nan("p50"), fields.number_or_nan("p95"), fields.number_or_nan("max")};
  fields.refuse_unknown();
  return time;
}

void check_schema(JsonFields& fields) {
  const std::int64_t schema = fields.integer("schema");
  if (schema != kRowSchema)
    throw InputError(fmt::format("episode row: expected schema {}, found {}", kRowSchema, schema));
}

void read_identity(JsonFields& fields, EpisodeRow& row) {
  row.key = fields.text("key");
  if (row.key.empty()) throw InputError("episode row: key 'key': expected a digest, found \"\"");
  row.suite = fields.text("suite");
  row.suite_version = fields.text("suite_version");
  row.suite_hash = fields.text("suite_hash");
  row.task = fields.text("task");
  row.clip = fields.text("clip");
  row.episode = small_integer(fields, "episode", "episode row");
  row.seed = fields.unsigned_integer("seed");
  row.engine = fields.text("engine");
  row.engine_version = fields.text("engine_version");
  row.engine_profile = fields.text("engine_profile");
  row.profile_digest = fields.text("profile_digest");
  row.controller = fields.text("controller");
  row.controller_digest = fields.text("controller_digest");
  row.policy = fields.text("policy");
  row.policy_digest = fields.text("policy_digest");
  row.perturbation = fields.text("perturbation");
  row.robot_digest = fields.text("robot_digest");
  row.arm = arm_from(fields.text("arm"));
}

void read_result(JsonFields& fields, EpisodeRow& row) {
  row.outcome = outcome_from(fields.text("outcome"));
  row.message = fields.text("message");
  row.detectors = fields.text("detectors");
  if (!fields.at("success").is_null()) row.success = fields.boolean("success");
  row.verdicts = items_from_json(fields.at("verdicts"), "verdicts", "verdict", verdict_from_json);
  row.metrics = fields.numbers("metrics", false);
  row.fell = fields.boolean("fell");
  row.frames = small_integer(fields, "frames", "episode row");
  row.sim_s = fields.number_or_nan("sim_s");
  row.wall_s = fields.number_or_nan("wall_s");
  row.contact_peak_n = fields.number_or_nan("contact_peak_n");
  row.contact_impulse_ns = fields.number_or_nan("contact_impulse_ns");
  row.late_plans = small_integer(fields, "late_plans", "episode row");
  row.state_hash = fields.text("state_hash");
  row.started_at = fields.text("started_at");
}

void read_details(JsonFields& fields, EpisodeRow& row) {
  row.forces = fields.numbers("forces", false);
  row.contacts = items_from_json(fields.at("contacts"), "contacts", "contact", contact_from_json);
  row.contacts_total = small_integer(fields, "contacts_total", "episode row");
  row.trace = trace_from_json(fields.at("trace"));
  row.feet = feet_from_json(fields.at("feet"));
  row.faults = faults_from_json(fields.at("faults"));
  row.policy_faults = policy_faults_from_json(fields.at("policy_faults"));
  row.policy_ms = policy_time_from_json(fields.at("policy_ms"));
}

}  // namespace

std::string episode_key(const EpisodeRow& row) {
  Sha256 hash;
  const std::string episode = fmt::format("{}", row.episode);
  for (const std::string* part :
       {&row.suite_hash, &row.detectors, &row.task, &row.clip, &episode, &row.arm, &row.policy, &row.policy_digest,
        &row.controller, &row.controller_digest, &row.engine, &row.perturbation}) {
    // The length first, so that no two different lists of parts read the same.
    hash.update(fmt::format("{}:", part->size()));
    hash.update(std::string_view(*part));
  }
  return hash.hex();
}

nlohmann::json to_json(const EpisodeRow& row) {
  return {{"schema", kRowSchema},
          {"key", row.key},
          {"suite", row.suite},
          {"suite_version", row.suite_version},
          {"suite_hash", row.suite_hash},
          {"task", row.task},
          {"clip", row.clip},
          {"episode", row.episode},
          {"seed", row.seed},
          {"engine", row.engine},
          {"engine_version", row.engine_version},
          {"engine_profile", row.engine_profile},
          {"profile_digest", row.profile_digest},
          {"controller", row.controller},
          {"controller_digest", row.controller_digest},
          {"policy", row.policy},
          {"policy_digest", row.policy_digest},
          {"perturbation", row.perturbation},
          {"robot_digest", row.robot_digest},
          {"arm", row.arm},
          {"outcome", std::string(to_string(row.outcome))},
          {"message", row.message},
          {"detectors", row.detectors},
          {"success", row.success.has_value() ? nlohmann::json(*row.success) : nlohmann::json(nullptr)},
          {"verdicts", list_json(row.verdicts)},
          {"metrics", finite_only(row.metrics)},
          {"fell", row.fell},
          {"frames", row.frames},
          {"sim_s", number_or_null(row.sim_s)},
          {"wall_s", number_or_null(row.wall_s)},
          {"contact_peak_n", number_or_null(row.contact_peak_n)},
          {"contact_impulse_ns", number_or_null(row.contact_impulse_ns)},
          {"forces", finite_only(row.forces)},
          {"contacts", list_json(row.contacts)},
          {"contacts_total", row.contacts_total},
          {"trace", to_json(row.trace)},
          {"feet", to_json(row.feet)},
          {"faults", to_json(row.faults)},
          {"late_plans", row.late_plans},
          {"policy_faults", to_json(row.policy_faults)},
          {"policy_ms", to_json(row.policy_ms)},
          {"state_hash", row.state_hash},
          {"started_at", row.started_at}};
}

EpisodeRow row_from_json(const nlohmann::json& json) {
  JsonFields fields(json, "episode row");
  EpisodeRow row;
  check_schema(fields);
  read_identity(fields, row);
  read_result(fields, row);
  read_details(fields, row);
  fields.refuse_unknown();
  return row;
}

}  // namespace duet
