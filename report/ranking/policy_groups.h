// Rows by policy, for the tables of policy experiments: one group per (engine, controller, arm, policy), its episodes
// by perturbation. The null arm is no policy, and episodes that could not run say nothing of one: both are left out.
#pragma once

#include <compare>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "duet/report/tables/estimate.h"
#include "duet/rows/groups/row_groups.h"

namespace duet {

inline constexpr std::string_view kClean = "clean";

struct PolicyKey {
  std::string engine, controller, arm, policy;  // arms in the order main, shuffled
  auto operator<=>(const PolicyKey&) const = default;
};

PolicyKey policy_key(const EpisodeRow& row);

using EpisodeRows = std::map<EpisodeId, const EpisodeRow*>;
using PerturbedRows = std::map<std::string, EpisodeRows, std::less<>>;

// Keeps pointers into `rows`. Throws InputError: rows of two suites or suite versions, an episode that is there twice.
std::map<PolicyKey, PerturbedRows> rows_of_policies(const std::vector<EpisodeRow>& rows);

Rate make_rate(const SuccessByClip& success, double level);  // n = 0 without episodes
// Rates over episodes: the headline; a detector by name ("paper", "paper"), n = 0 where no episode has its verdict. As
// in the leaderboard an episode without the verdict has failed where others have it.
Rate headline_rate(const EpisodeRows& rows, double level);
Rate verdict_rate(const EpisodeRows& rows, std::string_view version, std::string_view thresholds, double level);

// Success of `a` minus that of `b` over the episodes of both.
struct PairedDifference {
  long pairs = 0;
  double difference = std::numeric_limits<double>::quiet_NaN();
  Interval interval = kNoInterval;  // Newcombe; by clip where a clip has several draws
};
PairedDifference paired_difference(const EpisodeRows& a, const EpisodeRows& b, double level);

// Keys of estimates of a policy, and estimates with these.
Estimate keys_of(const PolicyKey& key);
EstimatesOf estimates_of(const PolicyKey& key, Estimates& into);
void add_difference(std::string_view name, const PairedDifference& difference, const EstimatesOf& estimates);

}  // namespace duet
