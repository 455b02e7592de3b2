// The same L-BFGS as in lanes (retarget/lane_lbfgs.h), in double: the reference, and for robots that have no room
// there.
#pragma once

#include "duet/retarget/pair_problem.h"
#include "duet/retarget/pair_schedule.h"

namespace duet {

PairSolution solve_by_double_lbfgs(const PairProblem& problem, const PairOptions& options);

}  // namespace duet
