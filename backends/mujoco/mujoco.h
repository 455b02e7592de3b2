// The MuJoCo engine, or in a build without it a twin of this interface that says what is missing. What maps to what:
// backends/mujoco/README.md.
#pragma once

#include <memory>

#include "backends/backend.h"
#include "backends/factory.h"

namespace duet {

EngineInfo mujoco_info();

// Throws std::runtime_error with MuJoCo's own message where it refuses the model, MissingError in a build without it.
std::unique_ptr<Backend> make_mujoco_backend(const Scene& scene);

}  // namespace duet
