// The iterations of the two-stage schedule (A.1.2), and what a solver returns after the last.
#pragma once

#include <vector>

#include "duet/retarget/options.h"
#include "duet/retarget/pair_objective.h"

namespace duet {

// One iteration: its weights, its learning rate, and its place in Adam's count.
struct PairIteration {
  PairWeights weights;
  double rate = 0.0;
  double epsilon = 1e-8;
  int adam_step = 1;   // 1 after the moments are (re)set
  bool reset = false;  // Adam's moments start from zero
};
PairIteration pair_iteration(const PairOptions& options, int iteration);
inline int pair_iterations(const PairOptions& options) {
  return options.schedule.stage1_iterations + options.schedule.stage2_iterations;
}

// L-BFGS's first iterations have the weights of stage 1, as Adam's have: they choose the minimum that the others reach.
int imitation_iterations(const PairOptions& options);

struct PairSolution {
  PairVariables x;               // after the last iteration, before the Gaussian filter
  std::vector<PairTerms> terms;  // one per iteration, at its start (before its update)
  std::vector<double> total;     // weighted with the weights of the iteration's stage
  KernelKind kernel = KernelKind::kScalar;
};

}  // namespace duet
