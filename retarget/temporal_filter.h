// The preconditioner of L-BFGS: per variable a stiffness against itself (Gauss-Newton's, in the mean) and against its
// neighbours in time (L_temp's five bands), factorised as L D L^T with an L that is the same at every frame. Pure.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "duet/retarget/pair_problem.h"

namespace duet {

// The factor of one variable: L has 1, `first`, `second` on its diagonals; D is `scale`^2.
struct TemporalFactor {
  double first = 0.0, second = 0.0, scale = 1.0;
};

// Factor of stiffness + velocity (-1, 2, -1) + acceleration (1, -4, 6, -4, 1), all per frame; stiffness > 0.
TemporalFactor temporal_factor(double stiffness, double velocity, double acceleration);

// The preconditioner of T times the objective: per row of PairVariables::frames, and of the root's offset.
struct Preconditioner {
  std::vector<TemporalFactor> rows;
  double offset = 1.0;  // stiffness
};
Preconditioner make_preconditioner(const PairProblem& problem, const PairOptions& options, const PairWeights& weights);

}  // namespace duet
