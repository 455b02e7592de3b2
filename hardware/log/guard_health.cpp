#include "duet/hardware/log/guard_health.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "duet/core/json.h"
#include "duet/core/require.h"
#include "duet/rows/json_fields.h"

namespace duet {
namespace {

enum class Keeps { kLast, kMost, kLeast };

struct HealthNumber {
  const char* name;
  double GuardHealth::*value;
  Keeps keeps;
};
constexpr HealthNumber kNumbers[] = {{"time", &GuardHealth::time, Keeps::kLast},
                                     {"state_age", &GuardHealth::state_age, Keeps::kMost},
                                     {"planner_age", &GuardHealth::planner_age, Keeps::kMost},
                                     {"person_age", &GuardHealth::person_age, Keeps::kMost},
                                     {"odometry_age", &GuardHealth::odometry_age, Keeps::kMost},
                                     {"remote_age", &GuardHealth::remote_age, Keeps::kMost},
                                     {"dead_man_age", &GuardHealth::dead_man_age, Keeps::kMost},
                                     {"executor_age", &GuardHealth::executor_age, Keeps::kMost},
                                     {"state_delay", &GuardHealth::state_delay, Keeps::kMost},
                                     {"late", &GuardHealth::late, Keeps::kMost},
                                     {"charge", &GuardHealth::charge, Keeps::kLast},
                                     {"casing", &GuardHealth::casing, Keeps::kMost},
                                     {"winding", &GuardHealth::winding, Keeps::kMost},
                                     {"tilt", &GuardHealth::tilt, Keeps::kMost},
                                     {"joint_speed", &GuardHealth::joint_speed, Keeps::kMost},
                                     {"gyro", &GuardHealth::gyro, Keeps::kMost},
                                     {"share", &GuardHealth::share, Keeps::kLeast},
                                     {"distance", &GuardHealth::distance, Keeps::kLeast},
                                     {"tracking", &GuardHealth::tracking, Keeps::kMost}};

struct HealthCount {
  const char* name;
  long GuardHealth::*value;
};
constexpr HealthCount kCounts[] = {{"ticks", &GuardHealth::ticks},
                                   {"states", &GuardHealth::states},
                                   {"checksum_faults", &GuardHealth::checksum_faults},
                                   {"tick_faults", &GuardHealth::tick_faults},
                                   {"number_faults", &GuardHealth::number_faults},
                                   {"old_messages", &GuardHealth::old_messages},
                                   {"bad_messages", &GuardHealth::bad_messages},
                                   {"restarts", &GuardHealth::restarts},
                                   {"left_out", &GuardHealth::left_out}};

double age_of(double now, double at) { return std::isfinite(at) ? now - at : kUnknown; }

// The value whose name is `text`; throws where none has it.
template <typename Value>
Value named(const std::string& text, int count, std::string_view (*name_of)(Value), const std::string& name) {
  for (int k = 0; k < count; ++k)
    if (name_of(static_cast<Value>(k)) == text) return static_cast<Value>(k);
  throw InputError(fmt::format("{}: expected a state and a cause of the guard, found '{}'", name, excerpt(text)));
}

long count_from(const nlohmann::json& json, const std::string& name) {
  constexpr long kMost = 1'000'000'000'000;
  if (!json.is_number_integer() || json < 0 || json > kMost)
    throw InputError(fmt::format("{}: expected counts from 0 to {}, found {}", name, kMost, excerpt(dumped(json))));
  return json.get<long>();
}

std::string age_text(const char* of, double age) {
  if (!std::isfinite(age)) return fmt::format("{} never", of);
  return fmt::format("{} {:.0f} ms", of, 1e3 * age);
}

std::string known(double value, const char* unit, int digits) {
  return std::isfinite(value) ? fmt::format("{:.{}f} {}", value, digits, unit) : "not known";
}

}  // namespace

std::string estimate_name(std::size_t fault) { return fault == 0 ? "used" : std::string(kPersonFaultNames[fault]); }

std::string datagram_name(std::size_t refusal) {
  return refusal == 0 ? "taken" : std::string(kSealRefusalNames[refusal]);
}

void fill_health(const RobotGuard& guard, GuardHealth& health) {
  const GuardStatus& status = guard.status();
  const SafetyInput& input = status.input;
  health.state = status.safety.state;
  health.cause = status.safety.cause;
  health.stands = input.stands;
  health.time = input.now;
  health.state_age = age_of(input.now, input.state_at);
  health.planner_age = age_of(input.now, input.planner_at);
  health.person_age = age_of(input.now, input.person_at);
  health.odometry_age = age_of(input.now, input.odometry_at);
  health.remote_age = age_of(input.now, input.remote_at);
  health.dead_man_age = age_of(input.now, input.dead_man_at);
  health.executor_age = age_of(input.now, input.executor_at);
  health.state_delay = input.state_delay;
  health.doubtful_joint = input.health.joints.joint;
  health.charge = guard.setup().has_battery ? input.health.charge : kUnknown;
  health.casing = input.health.casing;
  health.winding = input.health.winding;
  health.tilt = input.health.tilt;
  health.joint_speed = input.health.joint_speed;
  health.gyro = input.health.gyro;
  health.share = status.share;
  health.ticks = status.ticks;
  health.states = status.states;
  health.checksum_faults = status.checksum_faults;
  health.tick_faults = status.tick_faults;
  health.number_faults = status.number_faults;
  health.old_messages = status.old_messages;
  health.bad_messages = status.bad_messages;
  health.person = status.person;
  health.network = status.network;
  health.restarts = status.restarts;
}

void widen(const GuardHealth& tick, GuardHealth& window) {
  const GuardHealth before = window;
  window = tick;
  for (const HealthNumber& number : kNumbers) {
    if (number.keeps == Keeps::kMost) window.*number.value = std::fmax(before.*number.value, tick.*number.value);
    if (number.keeps == Keeps::kLeast) window.*number.value = std::fmin(before.*number.value, tick.*number.value);
  }
}

std::string_view next_key(SafetyState state, bool stands) {
  switch (state) {
    case SafetyState::kOffline:
      return "no robot is heard";
    case SafetyState::kListen:
      return "wait: something is missing";
    case SafetyState::kReady:
      return "R1 held, and the word typed: arm";
    case SafetyState::kArmed:
      return "start: stand up; select: damp";
    case SafetyState::kStand:
      return stands ? "A with R1: run; select: damp" : "R1 held: go on to the stance; select: damp";
    case SafetyState::kRun:
      return "R1 let go: hold; select: damp";
    case SafetyState::kHold:
      return stands ? "A with R1: run again; select: damp" : "start with R1: stand up again; select: damp";
    case SafetyState::kDamp:
      return "none: wait until it listens, or Ctrl-C twice to end";
    case SafetyState::kFault:
      return "Ctrl-C twice: end, and start the guard anew";
  }
  return "";
}

nlohmann::json health_json(const HealthMessage& message) {
  nlohmann::json json = {{"state", safety_state_name(message.health.state)},
                         {"cause", stop_cause_name(message.health.cause)},
                         {"stands", message.health.stands},
                         {"missing", message.missing},
                         {"tracking_joint", message.tracking_joint},
                         {"next", message.next},
                         {"doubtful_joint", message.doubtful_joint}};
  for (const HealthNumber& number : kNumbers) json[number.name] = number_or_null(message.health.*number.value);
  for (const HealthCount& count : kCounts) json[count.name] = message.health.*count.value;
  for (std::size_t k = 0; k < kPersonFaults; ++k) json["estimates"][estimate_name(k)] = message.health.person[k];
  for (std::size_t k = 0; k < kSealRefusals; ++k) json["network"][datagram_name(k)] = message.health.network[k];
  return json;
}

HealthMessage parse_health(std::string_view text, const std::string& name) {
  const nlohmann::json json = parse_json(text, name);
  HealthMessage message;
  try {
    message.health.state = named(json.at("state").get<std::string>(), kSafetyStates, safety_state_name, name);
    message.health.cause =
        named(json.at("cause").get<std::string>(), static_cast<int>(kStopCauses), stop_cause_name, name);
    message.health.stands = json.at("stands").get<bool>();
    message.missing = json.at("missing").get<std::string>();
    message.tracking_joint = json.at("tracking_joint").get<std::string>();
    message.next = json.at("next").get<std::string>();
    if (json.contains("doubtful_joint")) message.doubtful_joint = json["doubtful_joint"].get<std::string>();
    for (const HealthNumber& number : kNumbers) {
      if (number.value == &GuardHealth::state_delay && !json.contains(number.name)) continue;  // not in logs of before
      message.health.*number.value = json.at(number.name).is_null() ? kUnknown : json.at(number.name).get<double>();
    }
    for (const HealthCount& count : kCounts) message.health.*count.value = count_from(json.at(count.name), name);
    if (json.contains("estimates"))  // not in logs of before
      for (std::size_t k = 0; k < kPersonFaults; ++k)
        message.health.person[k] = count_from(json["estimates"].at(estimate_name(k)), name);
    if (json.contains("network"))
      for (std::size_t k = 0; k < kSealRefusals; ++k)
        message.health.network[k] = count_from(json["network"].at(datagram_name(k)), name);
  } catch (const nlohmann::json::exception& error) {  // "[json.exception.out_of_range.403] key 'tilt' not found"
    const std::string_view what = error.what();
    throw InputError(fmt::format("{}: the health of a guard: {}", name, what.substr(what.find("] ") + 2)));
  }
  return message;
}

std::string health_text(const HealthMessage& message) {
  const GuardHealth& h = message.health;
  std::string text = fmt::format("{} ({}){}\n  next: {}\n", safety_state_name(h.state), stop_cause_name(h.cause),
                                 message.missing.empty() ? "" : ", missing: " + message.missing, message.next);
  if (const std::string_view why = stop_cause_text(h.cause); !why.empty()) text += fmt::format("  why: {}\n", why);
  if (!message.doubtful_joint.empty()) text += fmt::format("  in doubt: {}\n", message.doubtful_joint);
  text +=
      fmt::format("  ages: {}, {}, {}, {}, {}, {}, {}; ticks late by {:.1f} ms at most\n",
                  age_text("state", h.state_age), age_text("planner", h.planner_age), age_text("person", h.person_age),
                  age_text("odometry", h.odometry_age), age_text("remote control", h.remote_age),
                  age_text("dead-man switch", h.dead_man_age), age_text("executor", h.executor_age), 1e3 * h.late);
  constexpr double kShown = 0.001;  // [s]
  if (h.state_delay > kShown)
    text += fmt::format("  states come {:.0f} ms later than the fastest did\n", 1e3 * h.state_delay);
  text += fmt::format("  charge {}, hottest casing {:.0f} and winding {:.0f} degrees C, tilt {:.3f} rad\n",
                      known(h.charge, "%", 0), h.casing, h.winding, h.tilt);
  const std::string estimates = person_counts_text(h.person);
  text += fmt::format("  person: {}; {:.0f} % of all speeds{}\n", known(h.distance, "m away", 2), 100.0 * h.share,
                      estimates.empty() ? "" : "; " + estimates);
  if (const std::string network = network_counts_text(h.network); !network.empty())
    text += fmt::format("  {}\n", network);
  text += fmt::format("  tracking: {}{}\n", known(h.tracking, "rad at most off a target", 3),
                      message.tracking_joint.empty() ? "" : fmt::format(" ({})", message.tracking_joint));
  text += fmt::format(
      "  {} states; {} with a wrong checksum, {} old, {} not finite; messages: {} old, {} not taken; {} streams began "
      "anew; {} ticks not in the log",
      h.states, h.checksum_faults, h.tick_faults, h.number_faults, h.old_messages, h.bad_messages, h.restarts,
      h.left_out);
  return text;
}

nlohmann::json json_schema_of(const nlohmann::json& sample, const std::string& title) {
  if (sample.is_string()) return {{"type", "string"}};
  if (sample.is_boolean()) return {{"type", "boolean"}};
  if (!sample.is_object()) return {{"type", "number"}};
  nlohmann::json properties = nlohmann::json::object();
  for (const auto& [name, member] : sample.items()) properties[name] = json_schema_of(member, "");
  nlohmann::json schema = {{"type", "object"}, {"properties", std::move(properties)}};
  if (!title.empty()) schema["title"] = title;
  return schema;
}

}  // namespace duet
