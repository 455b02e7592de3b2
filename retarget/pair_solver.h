// Solves a prepared PAIR problem: Adam with the two-stage schedule of A.1.2, in double (reference) or in SIMD lanes.
// Single-threaded; callers run sequences in parallel. Same problem, same kernel: bitwise the same solution.
#pragma once

#include <array>
#include <string_view>
#include <vector>

#include "duet/retarget/options.h"
#include "duet/retarget/pair_objective.h"
#include "duet/retarget/pair_problem.h"
#include "duet/retarget/pair_schedule.h"

namespace duet {

// Throws std::invalid_argument for options that do not validate and for a robot that the named kernel has no room for
// (48 joints, 32 points); MissingError for a kernel that this processor cannot run. kAuto takes the best that fits.
PairSolution solve_pair(const PairProblem& problem, const PairOptions& options);

// The kernel that `options.kernel` stands for here; throws as solve_pair does.
KernelKind choose_kernel(const PairProblem& problem, const PairOptions& options);

// Throughput in frames per second of CPU time of this thread, best of `rounds`.
struct PairTiming {
  int frames = 0;                         // at 50 Hz
  double solver = 0.0;                    // solve_pair on a prepared problem
  double whole = 0.0;                     // retarget(), from clip to PairedMotion
  KernelKind kernel = KernelKind::kAuto;  // the one used
};
PairTiming time_pair(const InteractionClip& clip, const RobotModel& robot, const PairOptions& options, int rounds);

}  // namespace duet
