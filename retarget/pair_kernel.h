// The SIMD solvers: Adam with the paper's schedule, and L-BFGS, over a problem in blocks of 16 lanes.
#pragma once

#include "duet/retarget/kernels.h"
#include "duet/retarget/lane_problem.h"
#include "duet/retarget/pair_schedule.h"

namespace duet {

PairSolution solve_in_lanes(const PairProblem& problem, const PairOptions& options, KernelKind kernel);

}  // namespace duet
