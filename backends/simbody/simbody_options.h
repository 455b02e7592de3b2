// The settings of the step around Simbody that a profile may change.
#pragma once

#include <span>

#include "duet/backends/engine_options.h"

namespace duet {

struct SimbodySettings {
  double contact_stiffness = 0.0;  // of a rigid contact point [N/m]
  double contact_damping = 0.0;    // [N s/m]
  double stop_erp = 0.0;
  int sweeps = 0;
};

std::span<const EngineOption> simbody_options();
// Throws std::invalid_argument as check_options.
SimbodySettings simbody_settings(const EngineOptions& options);

}  // namespace duet
