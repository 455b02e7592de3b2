// The leaderboard: success per group with intervals beside the null arm, metrics.
#pragma once

#include <map>
#include <string>
#include <vector>

#include "duet/report/tables/analysis.h"
#include "duet/rows/episode_row.h"
#include "duet/statistics/statistics.h"

namespace duet {

// Success of one (engine, controller, policy, perturbation) over one task, or over all ("all", micro average).
struct LeaderboardEntry {
  std::string engine, controller, policy, perturbation, task;
  long n = 0, k = 0;  // headline: main detector
  double success = 0.0;
  Interval interval;                            // Wilson; by clip where a clip has several draws
  double null_success = 0.0;                    // same episodes under the null arm; NaN where not run
  double lift = 0.0;                            // success - null_success
  Interval lift_interval;                       // paired Newcombe, likewise
  std::map<std::string, double> other_success;  // "paper/paper", "robot/strict", ... -> rate
  long fell = 0, diverged = 0, timed_out = 0, errors = 0;
  std::map<std::string, double> metrics;  // mean over episodes that have it
  std::string arm = "main";               // the null and the shuffled arm have entries of their own
  double level = 0.95;                    // of both intervals
  long pairs = 0;  // episodes that the null arm has too: null_success, lift and its interval are over these
  long unsupported = 0;
  long unjudged = 0;                       // ended well but no detector ruled on it; counted as a failure
  long plans_late = 0, plans_invalid = 0;  // plans of the policy that were left out, over all its episodes
  long policy_dead = 0;                    // episodes in which the policy gave no plan any more
  bool by_clip = false;                    // how the intervals are: a clip has several episodes
  std::string policy_fault = {};           // message of the first of those, by episode; it is another program's text
};

// Sorted by engine, controller, policy, perturbation, task (order of all_tasks(), "all" last); arms of one policy in
// turn. An episode succeeds where its headline verdict does and its outcome is ok. Throws InputError: rows of
// two suites or suite versions, an episode that is there twice.
std::vector<LeaderboardEntry> leaderboard(const std::vector<EpisodeRow>& rows, const IntervalOptions& options = {});

inline constexpr const char* kLeaderboardName = "leaderboard";  // of its analysis

// `columns`: units of metrics. Means of metrics are too long for a terminal where there are several physics engines.
Analysis leaderboard_analysis(const std::vector<LeaderboardEntry>& entries,
                              const std::vector<MetricColumn>& columns = {}, bool with_metrics = true);

}  // namespace duet
