// L-BFGS in lanes, preconditioned (retarget/temporal_filter.h) and projected on the joints' limits. Bitwise the same on
// AVX2 and AVX-512.
#pragma once

#include "duet/retarget/lane_problem.h"
#include "duet/retarget/pair_schedule.h"

namespace duet {

PairSolution solve_by_lane_lbfgs(const PairProblem& problem, const PairOptions& options, KernelKind kernel);

}  // namespace duet
