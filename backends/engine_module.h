// An engine is a shared object beside the program, duet_<name>.so, loaded when it is first asked for: a machine that
// lacks one engine's library still runs the others, and a new engine needs no change to duet. docs/extending.md.
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <string>

#include "duet/backends/backend.h"
#include "duet/backends/engine_deviation.h"
#include "duet/backends/engine_interface.h"
#include "duet/backends/engine_options.h"
#include "duet/core/version.h"

namespace duet {

struct EngineModule {
  // Both are set by themselves; a module whose interface is not the program's is refused, and what stands behind these
  // two members is then not looked at.
  std::uint64_t interface = engine_interface();
  const char* built_with = duet_version();
  const char* name = "";
  std::string (*version)() = nullptr;  // the engine's own
  // Throws std::invalid_argument (scene, options) and std::runtime_error with the engine's message where it refuses.
  std::unique_ptr<Backend> (*make)(const Scene& scene) = nullptr;
  std::span<const EngineOption> options;  // what a profile may set
  // The cost of the engine itself, against which the overhead of Backend::step is measured: CPU seconds for `steps`
  // steps from `state` under `command`, by the least code that makes the same engine calls under the same torque law
  // and reads the state back. Throws std::invalid_argument for steps < 1.
  double (*bare_step_seconds)(const Scene& scene, const RobotState& state, const JointCommand& command,
                              int steps) = nullptr;
  // At most so long a step of the G1 standing on its feet is to take, under `duet bench` [us]; 0: nothing is asked.
  double step_target_us = 0.0;
  std::span<const EngineDeviation> deviations = {};
};

}  // namespace duet

// The one symbol that a module exports. DUET_ENGINE_MODULE(module) defines it.
extern "C" const duet::EngineModule* duet_engine_module();

#define DUET_ENGINE_MODULE(module) \
  extern "C" __attribute__((visibility("default"))) const duet::EngineModule* duet_engine_module() { return &(module); }
