// The memory of L-BFGS, as products of its vectors alone (Chen, Wang, Zhou 2014, "vector-free L-BFGS"): the two loops
// run on a few numbers, whatever the vectors are made of.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "duet/retarget/kernel_types.h"

namespace duet {

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

}  // namespace duet
