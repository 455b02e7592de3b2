// The status of a guard, as `duet hw` prints it: for the screen, and as JSON.
#pragma once

#include <nlohmann/json.hpp>
#include <string>

#include "duet/hardware/robot_guard.h"

namespace duet::cli {

nlohmann::json status_json(const RobotGuard& guard);
// `seconds`: for which it has listened.
std::string status_text(const RobotGuard& guard, double seconds);

// Asks the system for real-time priority, for this thread and those that it makes from now on, and says what came of
// it.
std::string real_time_text();

}  // namespace duet::cli
