// Solves a prepared PAIR problem: Adam with the two-stage schedule of A.1.2, in double (reference) or in SIMD lanes.
// Single-threaded; callers run sequences in parallel. Same problem, same kernel: bitwise the same solution.
#pragma once

#include <array>
#include <string_view>
#include <vector>

#include "duet/retarget/options.h"
#include "duet/retarget/pair_problem.h"
#include "duet/retarget/solver/lbfgs.h"

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

// The same problem in libtorch's autograd, float, one thread: the way the paper solves it (A.1.3), as a peer for
// `duet bench pair/paper/libtorch` and an independent check of the objective. Optional (DUET_WITH_LIBTORCH).

bool libtorch_available();

// Runs the paper-mode schedule for its first `iterations` iterations and returns what the throughput of all 200 would
// be: frames at 50 Hz per second of CPU time. Sets libtorch to one thread and tells malloc to keep freed memory
// (mallopt, for the whole process), which is the faster of its two states. Throws MissingError without libtorch.
double libtorch_frames_per_second(const InteractionClip& clip, const RobotModel& robot, int iterations);

// Objective at the start of each iteration, as in PairSolution::total, of the paper mode with the given keypoints'
// problem. Throws MissingError without libtorch.
std::vector<double> libtorch_objective(const PairProblem& problem, int iterations);

}  // namespace duet
