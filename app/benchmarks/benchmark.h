// `duet bench`: named measurements in Google Benchmark's form. Each returns figures with units; ratios are to a bare
// loop or a peer timed in the same run.
#pragma once

#include <functional>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "duet/metrics/detector.h"
#include "duet/motion/interaction_clip.h"

namespace duet {

struct BenchmarkFigure {
  std::string name;  // "pair/paper/avx2", or with a suffix "backend/mujoco/step:real_time_factor"
  double value = 0.0;
  std::string unit;    // "frames/s", "us", "1", ...
  std::string target;  // what it is to reach, as text ("at least 25000"); empty where none
  bool reached = true;
};

struct BenchmarkOptions {
  double seconds = 1.0;  // measuring time of one figure, about
  int threads = 2;
};

struct Benchmark {
  std::string name;  // a path: "pair/paper/avx2"
  std::string description;
  std::function<std::vector<BenchmarkFigure>(const BenchmarkOptions&)> run;
};

// All benchmarks, in the order in which they are printed.
const std::vector<Benchmark>& benchmarks();

// A table that is printed instead of figures: `duet bench detectors` (confusion of the detectors on synthetic clips).
struct ConfusionTable {
  std::vector<std::string> tasks;
  std::vector<std::vector<double>> rate;  // [clips of task][detector], fraction accepted
  int clips = 0;
};
ConfusionTable detector_confusion(int clips_per_task, int threads, ThresholdSet set);

// The benchmarks by room, for the registry; each function adds its own to the list.

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

// CPU time of this thread, what a loop of it costs, memory: the clock and the scales of `duet bench`.

double cpu_seconds();       // of this thread [s]
double wall_seconds();      // monotonic [s]
double peak_memory_mib();   // largest resident memory of this process so far, or since the next function was called
void forget_peak_memory();  // gives the system back what is free, too

// CPU seconds of one call: repeats `work` in batches until about `seconds` have passed and takes the best batch, so
// that other load on the machine disturbs little.
double best_call_seconds(const std::function<void()>& work, double seconds);

}  // namespace duet
