// Golden baselines: `bless` writes aggregate figures with a tolerance each, `check` holds a run against them.
#pragma once

#include <string>
#include <vector>

#include "results/leaderboard.h"

namespace duet {

// JSON text: per leaderboard entry success and metrics, each {value, atol, rtol}.
std::string bless(const std::vector<LeaderboardEntry>& entries, const std::string& suite,
                  const std::string& suite_version);

struct GoldenDifference {
  std::string where;  // "mujoco/vmc/replay clean hug success"
  double expected = 0.0, found = 0.0, tolerance = 0.0;
  bool missing = false;  // the run has no such figure
};

// Empty where all agree. Throws InputError for a broken baseline or one of another suite.
std::vector<GoldenDifference> check(const std::string& golden_json, const std::vector<LeaderboardEntry>& entries,
                                    const std::string& suite, const std::string& suite_version);

}  // namespace duet
