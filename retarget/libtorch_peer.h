// The same problem in libtorch's autograd, float, one thread: the way the paper solves it (A.1.3), as a peer for
// `duet bench pair/paper/libtorch` and an independent check of the objective. Optional (DUET_WITH_LIBTORCH).
#pragma once

#include <vector>

#include "duet/retarget/pair_problem.h"

namespace duet {

bool libtorch_available();

// Runs the paper-mode schedule for its first `iterations` iterations and returns what the throughput of all 200 would
// be: frames at 50 Hz per second of CPU time. Sets libtorch to one thread and tells malloc to keep freed memory
// (mallopt, for the whole process), which is the faster of its two states. Throws MissingError without libtorch.
double libtorch_frames_per_second(const InteractionClip& clip, const RobotModel& robot, int iterations);

// Objective at the start of each iteration, as in PairSolution::total, of the paper mode with the given keypoints'
// problem. Throws MissingError without libtorch.
std::vector<double> libtorch_objective(const PairProblem& problem, int iterations);

}  // namespace duet
