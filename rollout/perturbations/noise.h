// Noise of what the controller measures.
#pragma once

#include "duet/rollout/perturbations/perturbation_kind.h"

namespace duet {

PerturbationKind noise_kind();

}  // namespace duet
