// Noise of what the controller measures.
#pragma once

#include "duet/rollout/perturbation_kind.h"

namespace duet {

PerturbationKind noise_kind();

}  // namespace duet
