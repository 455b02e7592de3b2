// Pushes at a link.
#pragma once

#include "duet/rollout/perturbations/perturbation_kind.h"

namespace duet {

PerturbationKind push_kind();

}  // namespace duet
