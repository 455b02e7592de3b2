// The settings of MuJoCo that a profile may change, and the values that hold for a scene.
#pragma once

#include <span>
#include <string>

#include "duet/backends/engine_options.h"

namespace duet {

std::span<const EngineOption> mujoco_options();

struct MujocoSettings {
  std::string solver, cone, jacobian, integrator;
  int iterations = 0;
  double tolerance = 0.0;
  double impratio = 0.0;
  double ground_time_constant = 0.0;  // [s]
};

// Options are checked before (check_options).
MujocoSettings mujoco_settings(const EngineOptions& options);

}  // namespace duet
