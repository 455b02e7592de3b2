// The cost of a step around Simbody by itself: the loop against which the overhead of Backend::step is measured.
#pragma once

#include "duet/backends/backend.h"
#include "duet/core/robot_state.h"

namespace duet {

// CPU seconds for `steps` steps from `state` under `command`: Simbody's dynamics, the torque law, the ground's contacts
// and the state read back; no checks, pushes, partner or reports. Throws std::invalid_argument for steps < 1 and what
// making the backend throws.
double simbody_bare_step_seconds(const Scene& scene, const RobotState& state, const JointCommand& command, int steps);

}  // namespace duet
