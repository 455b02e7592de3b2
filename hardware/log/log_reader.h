// Reads the log of a run message by message (docs/hardware.md, "Log"), in every form since its first: without chunks,
// with chunks of one message, packed with an index; frames as CDR or as the C structs that were once in their place.
#pragma once

#include <functional>
#include <nlohmann/json.hpp>
#include <string>

#include "duet/hardware/log/guard_health.h"
#include "duet/hardware/log/run_log.h"

namespace duet {

// A change of the guard's state; or, in it, something that was counted.
struct LogEvent {
  double time = 0.0;  // by the guard's clock [s]
  std::string state, cause;
  long dropped = 0;      // ticks that are not in the log here
  long restarts = 0;     // streams that were taken again after a pause
  std::string text;      // as it stands in the log
  long refused = 0;      // estimates of a person
  std::string why = {};  // they were
  long kept_out = 0;     // datagrams from other computers, and why
};

// A function for each kind of message; those without a function are passed over. A tick comes before the frames of
// its state and command, and before its event.
struct LogParts {
  std::function<void(const LimiterSetup& setup, const nlohmann::json& json)> setup = {};
  std::function<void(const TickRecord& tick)> tick = {};
  std::function<void(const LowStateFrame& frame)> state = {};
  std::function<void(const LowCommandFrame& frame)> command = {};
  std::function<void(const LogEvent& event)> event = {};
  std::function<void(const HealthMessage& message)> health = {};  // not in logs of before
};

// Whether the log has its end: otherwise its writer was stopped, and it was read as far as it goes. Throws InputError
// for a file that is no such log, made for another robot than the one whose card is here, or of ticks that are older
// than kTickEncoding.
bool read_run_log(const std::string& path, const LogParts& parts);

}  // namespace duet
