// Mass that the controller does not know.
#pragma once

#include "duet/rollout/perturbations/perturbation_kind.h"

namespace duet {

PerturbationKind mass_kind();

}  // namespace duet
