// The SIMD solver: packs a PairProblem into blocks of 16 lanes and runs a kernel over them. Which kernels there are.
#pragma once

#include "retarget/pair_solver.h"

namespace duet {

bool kernel_runs_here(KernelKind kernel);
bool kernel_fits(const PairProblem& problem);  // whether the robot fits the kernels' arrays
PairSolution solve_in_lanes(const PairProblem& problem, const PairOptions& options, KernelKind kernel);

}  // namespace duet
