// The cost of ODE itself: the loop against which the overhead of Backend::step is measured.
#pragma once

#include "duet/backends/backend.h"
#include "duet/core/robot_state.h"

namespace duet {

// CPU seconds for `steps` steps of OdeStepper from `state`, each with the points where the robot touches and reading
// the state back, without Backend's checks, pushes and reports. Throws std::invalid_argument for steps < 1 and what
// making the backend throws.
double ode_bare_step_seconds(const Scene& scene, const RobotState& state, const JointCommand& command, int steps);

}  // namespace duet
