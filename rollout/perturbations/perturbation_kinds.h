// The kinds of perturbation: one table, from which they are read, written, hashed, listed and documented. A new kind
// that acts on the robot is a unit in rollout/kinds and a row here.
#pragma once

#include <vector>

#include "duet/rollout/perturbations/perturbation_kind.h"

namespace duet {

const std::vector<PerturbationKind>& perturbation_kind_table();

}  // namespace duet
