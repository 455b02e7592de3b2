// A PairProblem in blocks of 16 lanes, and one pass of a kernel over them: what the solvers in lanes share.
#pragma once

#include <array>
#include <vector>

#include "duet/retarget/kernels/kernel_types.h"
#include "duet/retarget/kernels/kernels.h"
#include "duet/retarget/pair_problem.h"
#include "duet/retarget/solver/lbfgs.h"

namespace duet {

// The functions of a kernel in lanes that runs here (kPortable or wider).
const pair_kernel::LaneKernel& lane_kernel(KernelKind kind);

bool kernel_fits(const PairProblem& problem);  // whether the robot fits the kernels' arrays

// Lane sums in float stay short, their total is in double.
inline constexpr int kBlocksPerSum = 64;

class LaneProblem {
 public:
  using Rows = std::vector<pair_kernel::Row>;
  using Sums = std::array<double, pair_kernel::kSums>;

  LaneProblem(const PairProblem& problem, const PairOptions& options, KernelKind kernel);

  [[nodiscard]] const pair_kernel::LaneKernel& kernel() const { return kernel_; }
  [[nodiscard]] const pair_kernel::Setup& setup() const { return setup_; }
  [[nodiscard]] int frames() const { return frames_; }
  [[nodiscard]] int blocks() const { return blocks_; }
  [[nodiscard]] std::size_t rows() const { return static_cast<std::size_t>(setup_.rows); }
  [[nodiscard]] std::size_t halo() const { return pair_kernel::kHalo * rows(); }
  [[nodiscard]] Rows make_rows() const { return Rows(static_cast<std::size_t>(blocks_) * rows()); }
  [[nodiscard]] Rows make_rows_with_halo() const {
    return Rows(static_cast<std::size_t>(blocks_) * rows() + 2 * halo());
  }
  // With its halo: where the search begins.
  [[nodiscard]] Rows rows_at_rest(const PairProblem& problem) const;
  // The row of PairVariables::frames that row i of a block is.
  [[nodiscard]] int variable_of(int row) const;

  // Factors of the gradient of T times the objective, without Adam's.
  [[nodiscard]] pair_kernel::Step make_step(const PairWeights& weights, const Eigen::Array3d& offset) const;
  // `sweep` needs its arrays; the rest is filled in.
  [[nodiscard]] Sums sweep(pair_kernel::Sweep sweep, const pair_kernel::Step& step) const;
  [[nodiscard]] PairTerms terms(const Sums& sums, const PairWeights& weights) const;
  // Block b < 0 or b >= blocks holds the neighbours in time of the first and last blocks: the same rows of another
  // block, shifted by whole lanes. Lanes without a neighbour get zero; their weights are zero too.
  void fill_halo(Rows& x) const;
  [[nodiscard]] PairVariables variables(const Rows& x, const Eigen::Array3d& offset) const;

 private:
  void pack_frame(const PairProblem& problem, int block, int lane);

  const PairOptions& options_;
  const pair_kernel::LaneKernel& kernel_;
  pair_kernel::Setup setup_;
  int frames_;
  int blocks_;
  int constant_rows_;
  int rows_in_time_;  // the first so many rows have neighbours in time
  Rows constants_;
};

// L-BFGS in lanes, preconditioned (retarget/solver/lbfgs.h) and projected on the joints' limits. Bitwise the same on
// AVX2 and AVX-512.
PairSolution solve_by_lane_lbfgs(const PairProblem& problem, const PairOptions& options, KernelKind kernel);

// The SIMD solvers: Adam with the paper's schedule, and L-BFGS, over a problem in blocks of 16 lanes.
PairSolution solve_in_lanes(const PairProblem& problem, const PairOptions& options, KernelKind kernel);

}  // namespace duet
