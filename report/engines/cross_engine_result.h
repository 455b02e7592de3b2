// Options and results of a comparison of engines (report/engines/cross_engine.h).
#pragma once

#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

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

struct EnginePairRanks {
  std::string engine_a, engine_b;
  long items = 0;      // that both engines ran
  long pairs = 0;      // of items
  long swapped = 0;    // pairs in opposite order in the two engines
  double tau_b = 0.0;  // NaN: not defined (fewer than 2 items, or all tied in one of the engines)
};

// Whether engines put items in the same order by success; an item's success is the mean over all that it was run with.
struct RankStability {
  std::string of;  // "combinations" (of controller and policy), "controllers", "policies"
  long items = 0;
  std::vector<EnginePairRanks> engines;
  double mean_tau_b = 0.0;  // over the pairs of engines where it is defined; NaN where nowhere
  long defined = 0;         // those pairs of engines
  long item_pairs = 0;      // pairs of items that some two engines both ran
  long swapped = 0;         // of them, those that some two engines put in opposite order
  // Over the pairs of engines that both ran two items or more, with intervals that draw clips again within their task;
  // NaN where there are none.
  Interval tau_interval = {};   // of mean_tau_b, over the draws in which it is defined
  double rank_violation = 0.0;  // mean_maximum_rank_violation, each engine of a pair as the reference in turn
  Interval violation_interval = {};
  double winner_changes = 0.0;  // share of pairs of engines without a best item in common
  Interval winner_interval = {};
};

// An engine's value of a metric minus that of playback in the same episode, whatever playback's controller.
struct MetricDrift {
  std::string controller, engine, metric;
  long pairs = 0;
  double playback = 0.0;  // mean over the pairs
  double mean = 0.0;      // of the differences
  Interval interval;      // bootstrap over clips
};

// When the states of two engines part in the same episode: the first frame of the traces in which a point differs by
// more than the distance asked for, or the end by a fall or divergence in one of the two alone. Censored at the end of
// the shorter trace. [s], Kaplan-Meier; NaN: not reached.
struct EngineParting {
  std::string controller, engine_a, engine_b;
  long pairs = 0;  // episodes with traces that can be compared: same points, same rate
  long parted = 0;
  long without_trace = 0;  // episodes of both engines that cannot
  double lower_quartile = 0.0, median = 0.0, upper_quartile = 0.0;
};

// One contact force over the engines, per episode of two or more engines that have it; episodes in which no engine has
// any force are left out, and so are names that end with no unit.
struct ForceAgreement {
  std::string name, unit;
  long episodes = 0;
  double typical = 0.0;                 // median over episodes of the engines' median [unit]
  double spread = 0.0;                  // median over episodes of (max - min) / mean over engines
  std::map<std::string, double> ratio;  // engine -> median over episodes of its value over the engines' median
};

struct CrossEngine {
  std::vector<RunEngine> engines;  // physics engines by name; fewer than two: nothing below is filled
  bool has_playback = false;
  double level = 0.95;
  double parting_distance = 0.05;
  std::vector<MetricColumn> metrics;   // as asked for
  std::vector<EngineSuccess> success;  // by perturbation, controller, policy
  std::vector<RankStability> ranks;    // controllers and policies alone where there are several of both
  std::vector<MetricDrift> drift;      // by controller, metric as asked for, engine
  std::vector<EngineParting> parting;  // by controller, engines
  std::vector<ForceAgreement> forces;  // by name
};

}  // namespace duet
