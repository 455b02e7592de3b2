// The header of a replay's data: robots, people, limits, scenes and tracks, with the places of their columns.
#pragma once

#include <nlohmann/json.hpp>

#include "duet/replay/replay_columns.h"
#include "duet/replay/replay_content.h"

namespace duet {

// Adds every column of the content to `columns`.
nlohmann::json replay_header(const ReplayContent& content, ReplayColumns& columns);

// Links with their hinges, shapes and outline: all that forward kinematics and drawing take.
nlohmann::json robot_json(const RobotModel& robot);

}  // namespace duet
