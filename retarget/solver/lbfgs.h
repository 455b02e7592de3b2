// L-BFGS in double, with its schedule, its memory and its preconditioner.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "duet/retarget/kernels/kernel_types.h"
#include "duet/retarget/options.h"
#include "duet/retarget/pair_problem.h"

namespace duet {

// The iterations of the two-stage schedule (A.1.2), and what a solver returns after the last.

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

// The same L-BFGS as in lanes (retarget/solver/lane_problem.h), in double: the reference, and for robots that have no
// room there.
PairSolution solve_by_double_lbfgs(const PairProblem& problem, const PairOptions& options);

// The memory of L-BFGS, as products of its vectors alone (Chen, Wang, Zhou 2014, "vector-free L-BFGS"): the two loops
// run on a few numbers, whatever the vectors are made of.

// Slots 0, 2, 4, ... hold s, the next ones y of `kMemory` pairs; the last index is the gradient's.
class LbfgsMemory {
 public:
  static constexpr int kPairs = pair_kernel::kMemory;
  static constexpr int kGradient = 2 * kPairs;

  // Slot of the pair that is stored next.
  [[nodiscard]] int next_slot() const { return 2 * (stored_ % kPairs); }
  [[nodiscard]] int pairs() const { return stored_ < kPairs ? stored_ : kPairs; }
  // Products of vectors i and j; symmetric.
  void set(int i, int j, double value) { gram_(i, j) = gram_(j, i) = value; }
  [[nodiscard]] double product(int i, int j) const { return gram_(i, j); }
  // Keeps the pair in next_slot() where its curvature is positive; says whether it did.
  bool keep();
  void forget() { stored_ = 0; }
  // Factors of the direction -H g: of each slot, and of the gradient at the end.
  [[nodiscard]] Eigen::VectorXd direction() const;

 private:
  int stored_ = 0;
  Eigen::MatrixXd gram_ = Eigen::MatrixXd::Zero(kGradient + 1, kGradient + 1);
};

// The preconditioner of L-BFGS: per variable a stiffness against itself (Gauss-Newton's, in the mean) and against its
// neighbours in time (L_temp's five bands), factorised as L D L^T with an L that is the same at every frame. Pure.

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
