// Golden baselines: `bless` writes aggregate figures with a tolerance each, `check` holds a run against them; and a run
// against another one field by field.
#pragma once

#include <string>
#include <vector>

#include "duet/report/ranking/leaderboard.h"
#include "duet/rows/folder/run_directory.h"

namespace duet {

// JSON text: the suite, and per leaderboard entry success and metrics, each {value, atol, rtol}. Success of fewer than
// kFewEpisodes episodes has no tolerance: one of them that fails where it succeeded is what a baseline is for.
inline constexpr long kFewEpisodes = 20;
std::string bless(const std::vector<LeaderboardEntry>& entries, const RunInfo& run);

struct GoldenDifference {
  std::string
      where;  // "mujoco/vmc/replay clean hug success"; of missing figures "policy 'replay'" where all of its are
  double expected = 0.0, found = 0.0, tolerance = 0.0;
  bool missing = false;  // the run has no such figure
  int figures = 1;       // that are missing for one reason: a policy, an engine or a task that did not run
};

// Empty where all agree. Throws InputError for a broken baseline or one of another suite, version or suite hash, with
// the lines of the suites that differ.
std::vector<GoldenDifference> check(const std::string& golden_json, const std::vector<LeaderboardEntry>& entries,
                                    const RunInfo& run);

// Bit for bit, by key: a sentence for each episode of the baseline that the run lacks or has otherwise, with the fields
// and both values. Throws InputError for runs of two suites.
std::vector<std::string> exact_differences(const Run& baseline, const Run& run);

}  // namespace duet
