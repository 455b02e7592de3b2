// The cost of MuJoCo itself: the loop against which the overhead of Backend::step is measured.
#pragma once

#include "duet/backends/backend.h"
#include "duet/core/robot_state.h"

namespace duet {

// CPU seconds for `steps` steps from `state` under `command`: the same compiled model, law and calls of MuJoCo as the
// backend's, each followed by reading the state back. No checks, no pushes, no reports of contacts. Throws
// std::invalid_argument for steps < 1 and what making the backend throws.
double mujoco_bare_step_seconds(const Scene& scene, const RobotState& state, const JointCommand& command, int steps);

}  // namespace duet
