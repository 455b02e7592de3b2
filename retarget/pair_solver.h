// Solves a prepared PAIR problem: Adam with the two-stage schedule of A.1.2, in double (reference) or in SIMD lanes.
// Single-threaded; callers run sequences in parallel. Same problem, same kernel: bitwise the same solution.
#pragma once

#include <array>
#include <string_view>
#include <vector>

#include "retarget/options.h"
#include "retarget/pair_objective.h"
#include "retarget/pair_problem.h"

namespace duet {

struct PairSolution {
  PairVariables x;               // after the last iteration, before the Gaussian filter
  std::vector<PairTerms> terms;  // one per iteration, at its start (before its update)
  std::vector<double> total;     // weighted with the weights of the iteration's stage
  KernelKind kernel = KernelKind::kScalar;
};

// Throws std::invalid_argument for options that do not validate and for a robot that the named kernel has no room for
// (48 joints, 32 points); MissingError for a kernel that this processor cannot run. kAuto takes the best that fits.
PairSolution solve_pair(const PairProblem& problem, const PairOptions& options);

// The kernel that `options.kernel` stands for here; throws as solve_pair does.
KernelKind choose_kernel(const PairProblem& problem, const PairOptions& options);

// What one iteration does: its weights, its learning rate, and its place in Adam's count.
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

// Throughput in frames per second of CPU time of this thread, best of `rounds`.
struct PairTiming {
  int frames = 0;                         // at 50 Hz
  double solver = 0.0;                    // solve_pair on a prepared problem
  double whole = 0.0;                     // retarget(), from clip to PairedMotion
  KernelKind kernel = KernelKind::kAuto;  // the one used
};
PairTiming time_pair(const InteractionClip& clip, const RobotModel& robot, const PairOptions& options, int rounds);

}  // namespace duet
