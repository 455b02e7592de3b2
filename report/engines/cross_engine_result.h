// Options and results of a comparison of engines (report/engines/cross_engine.h).
#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "duet/report/tables/estimate.h"
#include "duet/report/tables/metric_column.h"
#include "duet/rows/row_file.h"
#include "duet/statistics/statistics.h"

namespace duet {

struct CrossEngineOptions {
  IntervalOptions intervals = {};
  double parting_distance = 0.05;  // two engines have parted where a point of the traces differs by more [m]
  std::string arm = "main";
  RowFile file = {};  // where the traces of lean rows are
};

struct RunEngine {
  std::string name, version, profile;  // of several versions or profiles all, "2.2.2, 2.3.0"
};

struct EngineRate {
  std::string engine;
  long n = 0, k = 0;
  double rate = 0.0;  // NaN where n is 0
  Interval interval;  // Wilson; by clip where a clip has several draws
};

// Success of one (controller, policy, perturbation), over the episodes that all its engines ran.
struct EngineSuccess {
  std::string controller, policy, perturbation;
  long n = 0;                          // those episodes
  long left_out = 0;                   // episodes that only some of its engines ran
  std::vector<EngineRate> engines;     // physics engines that ran it, by name
  std::optional<EngineRate> playback;  // of the same episodes, under the same controller or else the first by name
  double mean = 0.0;                   // over engines, each counts the same
  Interval mean_interval;              // by clip (wilson_by_clip): says nothing of other engines
  double sd = 0.0;                     // sample standard deviation of the rates; NaN for fewer than 2 engines
  double range = 0.0;                  // highest minus lowest rate
  double noise_sd = 0.0;   // that independent binomial episodes would give: sqrt of the mean of p (1 - p) / (n - 1)
  double excess_sd = 0.0;  // tau by moments: sqrt(max(0, sd^2 - noise_sd^2))
};

struct CrossEngine {
  std::vector<RunEngine> engines;  // physics engines by name; fewer than two: nothing below is filled
  bool has_playback = false;
  double level = 0.95;
  double parting_distance = 0.05;
  std::vector<MetricColumn> metrics;   // as asked for
  std::vector<EngineSuccess> success;  // by perturbation, controller, policy
  Estimates ranks;                     // controllers and policies alone where there are several of both
  Estimates drift;                     // by controller, metric as asked for, engine
  Estimates parting;                   // by controller, engines
  Estimates forces;                    // by name
};

}  // namespace duet
