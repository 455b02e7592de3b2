// Messages of planner, perception and operator to the guard over its local socket: fixed sizes, little-endian, a number
// that tells the kind. The guard takes the time of reception, never the sender's. Pure functions; no allocation.
#pragma once

#include <array>
#include <cstddef>
#include <span>
#include <string>
#include <string_view>

#include "duet/hardware/guard/robot_guard.h"

namespace duet {

inline constexpr std::size_t kMostGuardBytes = 1024;
using GuardBuffer = std::array<std::byte, kMostGuardBytes>;

// The datagram's length in `buffer`. A planner's command has kG1Motors targets.
std::size_t encode(const PlannerMessage& message, GuardBuffer& buffer);
std::size_t encode(const PersonMessage& message, GuardBuffer& buffer);
std::size_t encode_stop(GuardBuffer& buffer);

enum class GuardMessageKind { kRefused, kPlanner, kPerson, kStop };

// Sets the one that it is. `planner.command.q` has kG1Motors entries before.
struct GuardMessage {
  PlannerMessage planner;
  PersonMessage person;

  GuardMessage() { planner.command.q.setZero(kG1Motors); }
};
GuardMessageKind decode(std::span<const std::byte> datagram, GuardMessage& message);

// The guard's report to its planner, 50 times a second: what it measured, what it sent, what it allows. Fixed size,
// little-endian, over a local socket at the guard's path with ".report" behind it. Pure functions; no allocation.

inline constexpr int kReportEvery = 10;  // ticks of the guard

struct GuardReport {
  std::uint64_t tick = 0;              // of the guard
  double now = 0.0;                    // by the guard's clock [s]
  std::uint64_t planner_sequence = 0;  // of the last planner's message that it took
  SafetyState state = SafetyState::kOffline;
  StopCause cause = StopCause::kNone;
  bool odometry = false;     // is measured and fresh
  double odometry_at = 0.0;  // [s]
  RobotState robot;          // measured: joints and orientation of the robot's state, place and speed of odometry
  Eigen::VectorXd tau;       // [N m]
  Eigen::VectorXd q_target;  // that every joint was sent [rad]
  VelocityCommand root;      // that came out of the limiter
  ClampCounts clamps{};
  long old_messages = 0;
  bool tracked = false;                      // a person is, and was not long ago
  HumanJoints person = HumanJoints::Zero();  // where, for a policy (RobotGuard::tracked), in the frame of odometry [m]

  GuardReport();
};

GuardReport report_of(const RobotGuard& guard);
// Fills the report in place; no allocation.
void fill_report(const RobotGuard& guard, GuardReport& report);

inline constexpr std::size_t kReportBytes = 8 * (12 + 13 + 4 * kG1Motors + 4 + kClampReasons + 3 * kSmplJoints);
using ReportBuffer = std::array<std::byte, kReportBytes>;
void encode(const GuardReport& report, ReportBuffer& buffer);
// False for anything that is not such a report, with numbers that are finite.
bool decode(std::span<const std::byte> datagram, GuardReport& report);

// The path that the reports of the guard at `socket` go to.
std::string report_path(const std::string& socket);
// The path where `duet hw status` waits for the health of that guard (hardware/log/guard_health.h).
std::string status_path(const std::string& socket);

}  // namespace duet
