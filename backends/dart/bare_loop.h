// The cost of DART itself: the loop against which the overhead of Backend::step is measured.
#pragma once

#include "duet/backends/backend.h"
#include "duet/core/robot_state.h"

namespace duet {

// EngineModule::bare_step_seconds for DART: the same contacts, torque law and calls of DART as the backend's, without
// its checks, reports and pushes.
double dart_bare_step_seconds(const Scene& scene, const RobotState& state, const JointCommand& command, int steps);

}  // namespace duet
