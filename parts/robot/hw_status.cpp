#include "duet/parts/robot/hw_status.h"

#include <fmt/format.h>

#include "duet/hardware/real_time.h"

namespace duet::cli {
namespace {

// Why it is not ready, or "ready".
std::string readiness(const RobotGuard& guard) {
  const GuardStatus& status = guard.status();
  if (status.safety.state == SafetyState::kOffline) return "no state has come";
  const std::string_view missing = missing_for_arming(guard.setup().rules, status.safety, status.input);
  if (!missing.empty()) return fmt::format("missing: {}", missing);
  const std::string state(safety_state_name(status.safety.state));
  const bool was_missing = status.safety.state == SafetyState::kListen && !status.safety.missing.empty();
  return was_missing ? fmt::format("{} (lately missing: {})", state, status.safety.missing) : state;
}

std::string clamp_text(const ClampCounts& clamps) {
  std::string text;
  for (std::size_t k = 0; k < kClampReasons; ++k)
    if (clamps[k] > 0) text += fmt::format("{}{} {}", text.empty() ? "" : ", ", kClampNames[k], clamps[k]);
  return text.empty() ? "none" : text;
}

// The keys that the guard reads, as they are held.
std::string keys_text(const RemoteControl& remote) {
  constexpr std::pair<RemoteKey, const char*> kKeys[] = {{RemoteKey::kR1, "R1"},         {RemoteKey::kStart, "start"},
                                                         {RemoteKey::kSelect, "select"}, {RemoteKey::kL2, "L2"},
                                                         {RemoteKey::kA, "A"},           {RemoteKey::kB, "B"}};
  std::string text;
  for (const auto& [key, name] : kKeys)
    if (remote.holds(key)) text += fmt::format("{}{}", text.empty() ? "" : ", ", name);
  return text.empty() ? "no key held" : text + " held";
}

// Readings to be compared with the robot at hand.
std::string reading_text(const RobotGuard& guard) {
  const RobotReading& reading = guard.reading();
  if (!reading.any) return "";
  std::string text =
      fmt::format("\n  mode_machine {} (configured: {}), mode_pr {}\n  joints [rad]:", reading.mode_machine,
                  guard.setup().mode_machine, reading.mode_pr);
  const std::vector<RobotJoint>& joints = guard.setup().limiter.robot->joints;
  constexpr std::size_t kInALine = 5;
  for (std::size_t j = 0; j < joints.size(); ++j)
    text += fmt::format("{}{} {:.3f}", j % kInALine == 0 ? "\n    " : ", ", joints[j].name,
                        reading.state.q[static_cast<Eigen::Index>(j)]);
  return text;
}

}  // namespace

std::string real_time_text() {
  return ask_for_real_time() ? "real-time priority: yes"
                             : "real-time priority: no (it takes CAP_SYS_NICE or a limit rtprio); a machine that is "
                               "busy with other things will be late, and hold the robot";
}

nlohmann::json status_json(const RobotGuard& guard) {
  const GuardStatus& status = guard.status();
  nlohmann::json clamps = nlohmann::json::object();
  for (std::size_t k = 0; k < kClampReasons; ++k) clamps[std::string(kClampNames[k])] = status.clamps[k];
  return {{"state", safety_state_name(status.safety.state)},
          {"cause", stop_cause_name(status.safety.cause)},
          {"readiness", readiness(guard)},
          {"states", status.states},
          {"checksum_faults", status.checksum_faults},
          {"tick_faults", status.tick_faults},
          {"number_faults", status.number_faults},
          {"old_messages", status.old_messages},
          {"restarts", status.restarts},
          {"clamps", clamps}};
}

std::string status_text(const RobotGuard& guard, double seconds) {
  const GuardStatus& status = guard.status();
  const RobotHealth& health = status.input.health;
  return fmt::format(
      "{}\n  {} states in {:.1f} s; {} with a wrong checksum, {} old, {} not finite\n  tilt {:.3f} rad, hottest casing "
      "{:.0f} and winding {:.0f} degrees C, charge {:.0f} %, remote control {}\n  other writers of commands: {}\n  "
      "clamps: {}{}",
      readiness(guard), status.states, seconds, status.checksum_faults, status.tick_faults, status.number_faults,
      health.tilt, health.casing, health.winding, health.charge,
      status.input.remote_at == kNever ? "not heard" : "heard, " + keys_text(guard.reading().remote),
      status.input.foreign_writer ? "yes" : "none", clamp_text(status.clamps), reading_text(guard));
}

}  // namespace duet::cli
