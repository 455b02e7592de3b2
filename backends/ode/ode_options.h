// The settings of ODE that a profile may change, with their defaults.
#pragma once

#include <span>

#include "duet/backends/contact_solver.h"
#include "duet/backends/engine_options.h"

namespace duet {

struct OdeOptions {
  Softness joint = {};    // of hinges
  Softness stop = {};     // of joint stops
  Softness contact = {};  // of contacts with the ground and between links
  bool stick = true;      // contacts that are foreseen to stick are given to ODE without a bound on friction
  int sweeps = 0;         // of Gauss-Seidel, where the forecast of ODE's forces needs it
};

std::span<const EngineOption> ode_option_table();
// Throws std::invalid_argument (check_options).
OdeOptions ode_options(const EngineOptions& options);

}  // namespace duet
