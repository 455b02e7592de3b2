// What MuJoCo itself costs: the loop against which the overhead of Backend::step is measured.
#pragma once

#include "backends/scene.h"
#include "core/robot_state.h"

namespace duet {

// CPU seconds for `steps` calls of mj_step, each followed by reading the state back, on the same compiled model as the
// backend's, from `state`, under the least code that applies `command`: joint damping set once, the rest of the torque
// clamped per joint. No checks, no saturation of the damping, no contacts. Throws std::invalid_argument for steps < 1
// and what making the backend throws.
double mujoco_bare_step_seconds(const Scene& scene, const RobotState& state, const JointCommand& command, int steps);

}  // namespace duet
