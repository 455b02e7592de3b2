#include "duet/rows/row_objects.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <set>

#include "duet/core/number.h"
#include "duet/core/require.h"

namespace duet {
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
