// No physics: the robot is where the followed reference says, from the step after follow() on. Velocities are finite
// differences between two calls of follow() (zero after the first). Torques are zero, nothing touches anything, pushes
// have no effect.
#pragma once

#include <memory>

#include "backends/backend.h"

namespace duet {

std::unique_ptr<Backend> make_playback_backend(const Scene& scene);

}  // namespace duet
