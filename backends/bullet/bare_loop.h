// The cost of Bullet itself: the loop against which the overhead of Backend::step is measured.
#pragma once

#include "duet/backends/backend.h"
#include "duet/core/robot_state.h"

namespace duet {

// CPU seconds for `steps` steps of BulletWorld from `state`, with the same contacts and the state read back: no checks,
// no pushes, no reports. Throws std::invalid_argument for steps < 1.
double bullet_bare_step_seconds(const Scene& scene, const RobotState& state, const JointCommand& command, int steps);

}  // namespace duet
