// Sudden changes of the robot's velocity.
#pragma once

#include "duet/rollout/perturbations/perturbation_kind.h"

namespace duet {

PerturbationKind kick_kind();

}  // namespace duet
