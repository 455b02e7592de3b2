// How well a run is at a moment: ages, battery, heat, the person's distance, tracking. Logs have it 50 times a second
// as plain JSON ("guard/health"), and `duet hw status` shows it. Pure functions.
#pragma once

#include <limits>
#include <nlohmann/json.hpp>
#include <string>
#include <string_view>

#include "duet/hardware/guard/robot_guard.h"

namespace duet {

inline constexpr double kUnknown = std::numeric_limits<double>::quiet_NaN();

// Ages are since reception [s]; NaN where nothing came yet, or nothing is known.
struct GuardHealth {
  SafetyState state = SafetyState::kOffline;
  StopCause cause = StopCause::kNone;
  bool stands = false;  // has reached its stance
  double time = 0.0;    // by the guard's clock [s]
  double state_age = kUnknown, planner_age = kUnknown, person_age = kUnknown, odometry_age = kUnknown;
  double remote_age = kUnknown, dead_man_age = kUnknown, executor_age = kUnknown;
  double state_delay = 0.0;                          // by which states come later than the fastest did [s]
  double late = 0.0;                                 // by which a tick came late [s]
  double charge = kUnknown;                          // [%]
  double casing = 0.0, winding = 0.0;                // hottest motor [degrees C]
  double tilt = 0.0, joint_speed = 0.0, gyro = 0.0;  // [rad], [rad/s]
  double share = kUnknown;                           // of all speeds, after the distance to a person
  double distance = kUnknown;                        // of the person from the robot, both as capsules [m]
  double tracking = kUnknown;                        // largest angle between a joint and its target [rad]
  int doubtful_joint = -1;                           // that cannot be where its states say; -1: none
  long ticks = 0, states = 0, checksum_faults = 0, tick_faults = 0, number_faults = 0;
  long old_messages = 0, bad_messages = 0, restarts = 0;
  long left_out = 0;        // ticks that the log has no room for
  PersonCounts person{};    // estimates of a person, by what became of them
  NetworkCounts network{};  // datagrams from other computers, the same
};

struct HealthMessage {
  GuardHealth health;
  std::string missing = {};         // before arming
  std::string tracking_joint = {};  // whose angle `tracking` is
  std::string next = {};            // what the operator may do now
  std::string doubtful_joint = {};  // the name of health.doubtful_joint
};

// The name of a count of estimates in messages: "used", "far", ...
std::string estimate_name(std::size_t fault);

// "taken", "forged", ...
std::string datagram_name(std::size_t refusal);

// All that the guard knows but distance, tracking, `late` and `left_out`. No allocation.
void fill_health(const RobotGuard& guard, GuardHealth& health);
// `tick` comes after `window`, which keeps the oldest age, the nearest person and the hottest motor of both.
void widen(const GuardHealth& tick, GuardHealth& window);

// The key that leads on, and the one that stops: "A with R1: run; select: damp".
std::string_view next_key(SafetyState state, bool stands);

nlohmann::json health_json(const HealthMessage& message);
// Throws InputError naming `name` for text that is no such message.
HealthMessage parse_health(std::string_view text, const std::string& name);
// For a terminal: a line for each group.
std::string health_text(const HealthMessage& message);

// The JSON schema of messages like `sample`, as viewers take it: a null is a number that is not known.
nlohmann::json json_schema_of(const nlohmann::json& sample, const std::string& title);

}  // namespace duet
