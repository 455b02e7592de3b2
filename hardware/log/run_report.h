// A run's log for a debriefing: states and why they changed, faults, what the limiter changed and where, how
// near the person came, ages, heat, rates, and how well joints followed.
#pragma once

#include <array>
#include <string>
#include <vector>

#include "duet/hardware/log/guard_health.h"
#include "duet/hardware/safety/limiter.h"

namespace duet {

// Times are since the log's first tick [s].
struct RunReport {
  struct Span {
    double begin = 0.0, seconds = 0.0;
    std::string state, cause;  // why it began
  };
  // Something that was counted: messages, states or ticks.
  struct Fault {
    std::string name;  // "checksum_faults", "dropped", ...
    double first = 0.0, last = 0.0;
    long count = 0;
  };
  // The largest value, and when; NaN where it was never known.
  struct Peak {
    double value = kUnknown, at = kUnknown;
  };
  struct Age {
    const char* name;
    Peak oldest;  // while it stood, ran or held
  };
  struct Joint {
    std::string name;
    double rms = 0.0, largest = 0.0;  // angle from the target that it was sent, while it ran [rad]
    double hottest = 0.0;             // casing or winding [degrees C]
    ClampCounts changed{};            // ticks while it ran
  };

  struct Check {
    std::string name, value;
    bool done = false;
  };

  std::string program, executor, odometry;  // as the log's setup names them
  std::string checked_by, checked_when;     // of the checklist; "" where the log has none
  std::vector<Check> checks;
  bool whole = false;               // the log has its end
  bool has_health = false;          // older logs do not: ages, charge and faults are not known then
  double seconds = 0.0, ran = 0.0;  // of the log; of it in the state `run`
  long ticks = 0, dropped = 0;      // in the log; that it had no room for
  long states = 0, missed = 0;      // of the robot; by its own count, between two that were read
  long commands = 0, plans = 0;     // frames that were sent; commands of a planner that came while it ran
  double commanded = 0.0;           // for which frames were sent [s]
  std::vector<Span> spans;
  std::vector<Fault> faults;
  ClampCounts changed{};  // while it ran: how often for each reason
  Peak nearest;           // least distance of the person, at any tick [m]
  Peak casing, winding, tilt, late;
  double charge_first = kUnknown, charge_last = kUnknown;  // [%]
  std::vector<Age> ages;
  std::vector<Joint> joints;  // of the robot, in the card's order
  long followed = 0;          // frames that `rms` is over
};

// Throws as read_run_log() (hardware/log/log_reader.h), and InputError for a log without ticks.
RunReport report_of_log(const std::string& path);

}  // namespace duet
