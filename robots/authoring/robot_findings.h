// Findings about a robot that loads, before a run: heights, soles, balance, roles, gains, limits, with figures
// and, where something is missing or contradicts itself, the next step. Thread-safe.
#pragma once

#include <string>
#include <vector>

#include "duet/robots/robot_model.h"

namespace duet {

enum class CheckState { kOk, kNote, kMissing, kWrong };
const char* to_string(CheckState state);  // "ok", "note", "missing", "wrong"

struct RobotFinding {
  std::string part;  // "joints", "soles", ...
  CheckState state = CheckState::kOk;
  std::string found;      // with figures and units
  std::string next = {};  // what to do; "" where there is nothing to be done
  bool stops = false;     // no run begins before this is mended
};

std::vector<RobotFinding> findings_of(const RobotModel& robot);

}  // namespace duet
