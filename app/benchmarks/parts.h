// The benchmarks by room, for the registry; each function adds its own to the list.
#pragma once

#include <vector>

#include "duet/app/benchmarks/benchmark.h"
#include "duet/motion/interaction_clip.h"

namespace duet {

void add_pair_benchmarks(std::vector<Benchmark>& list);
void add_metrics_benchmarks(std::vector<Benchmark>& list);
void add_kinematics_benchmarks(std::vector<Benchmark>& list);
void add_backend_benchmarks(std::vector<Benchmark>& list);
void add_nn_benchmarks(std::vector<Benchmark>& list);
void add_policy_benchmarks(std::vector<Benchmark>& list);
void add_runner_benchmarks(std::vector<Benchmark>& list);

// A figure with the least or the largest value that it is to reach.
BenchmarkFigure at_least(const std::string& name, double value, const std::string& unit, double target);
BenchmarkFigure at_most(const std::string& name, double value, const std::string& unit, double target);

// The clip that figures are timed on: a synthetic handshake of 1,007 frames, the paper's mean length.
InteractionClip benchmark_clip();

}  // namespace duet
