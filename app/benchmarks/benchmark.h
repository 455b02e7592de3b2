// `duet bench`: named measurements in Google Benchmark's form. Each returns figures with units; ratios are to a bare
// loop or a peer timed in the same run.
#pragma once

#include <functional>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "duet/metrics/detector.h"

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

}  // namespace duet
