#include "duet/report/ranking/leaderboard.h"

#include <fmt/format.h>

#include <algorithm>
#include <compare>
#include <limits>
#include <tuple>

#include "duet/core/require.h"
#include "duet/rows/groups/row_groups.h"

namespace duet {
namespace {

using RowList = std::vector<const EpisodeRow*>;

struct EntryKey {
  std::string engine, controller, policy, perturbation, arm;
  auto operator<=>(const EntryKey&) const = default;
};

// The null arm's counterpart of an episode: the same but for the policy.
using Counterpart = std::tuple<std::string, std::string, std::string, EpisodeId>;

Counterpart counterpart(const EpisodeRow& row) {
  return {row.engine, row.controller, row.perturbation, episode_id(row)};
}

// The rows of the null policy, which pair with the others; of several the first by name.
std::map<Counterpart, const EpisodeRow*> null_arm(const RowList& rows) {
  std::map<Counterpart, const EpisodeRow*> index;
  for (const EpisodeRow* row : rows) {
    if (row->arm != "null") continue;
    const auto [found, is_new] = index.try_emplace(counterpart(*row), row);
    if (!is_new && row->policy < found->second->policy) found->second = row;
  }
  return index;
}

void count_policy_faults(const PolicyFaults& faults, LeaderboardEntry& entry) {
  entry.plans_late += faults.late;
  entry.plans_invalid += faults.invalid;
  entry.policy_dead += faults.dead ? 1 : 0;
  if (entry.policy_fault.empty()) entry.policy_fault = faults.message;
}

void count_outcome(const EpisodeRow& row, LeaderboardEntry& entry) {
  ++entry.n;
  if (headline_success(row)) ++entry.k;
  if (row.fell || row.outcome == Outcome::kFell) ++entry.fell;
  if (row.outcome == Outcome::kDiverged) ++entry.diverged;
  if (row.outcome == Outcome::kTimedOut) ++entry.timed_out;
  if (row.outcome == Outcome::kError) ++entry.errors;
  if (row.outcome == Outcome::kUnsupported) ++entry.unsupported;
  if (row.outcome == Outcome::kOk && !row.success.has_value()) ++entry.unjudged;
  count_policy_faults(row.policy_faults, entry);
}

// Rates over all episodes of the entry: one without the verdict has failed, as in the headline.
void add_verdicts(const RowList& rows, LeaderboardEntry& entry) {
  for (const EpisodeRow* row : rows) {
    for (const Verdict& verdict : row->verdicts)
      entry.other_success[verdict.version + "/" + verdict.thresholds] += verdict_success(*row, verdict) ? 1.0 : 0.0;
  }
  for (auto& [name, count] : entry.other_success) count /= static_cast<double>(entry.n);
}

void add_metrics(const RowList& rows, LeaderboardEntry& entry) {
  std::map<std::string, long> counts;
  for (const EpisodeRow* row : rows) {
    for (const auto& [name, value] : row->metrics) {
      entry.metrics[name] += value;
      ++counts[name];
    }
  }
  for (auto& [name, sum] : entry.metrics) sum /= static_cast<double>(counts[name]);
}

void add_lift(const RowList& rows, const std::map<Counterpart, const EpisodeRow*>& null_rows, LeaderboardEntry& entry) {
  EpisodePairs pairs;
  for (const EpisodeRow* row : rows) {
    const auto found = row->arm == "null" ? null_rows.end() : null_rows.find(counterpart(*row));
    if (found != null_rows.end()) pairs.add(*row, *found->second);
  }
  entry.pairs = pairs.table().pairs();
  entry.null_success = entry.lift = std::numeric_limits<double>::quiet_NaN();
  entry.lift_interval = kNoInterval;
  if (entry.pairs == 0) return;
  entry.null_success = pairs.table().rate_b();
  entry.lift = pairs.table().difference();
  entry.lift_interval = pairs.of_episodes(entry.level);
}

void set_success(const RowList& rows, LeaderboardEntry& entry) {
  SuccessByClip success;
  for (const EpisodeRow* row : rows) success.add(episode_id(*row), headline_success(*row) ? 1.0 : 0.0);
  entry.success = static_cast<double>(entry.k) / static_cast<double>(entry.n);
  entry.interval = success.of_episodes(entry.level);
  entry.by_clip = success.several_a_clip();
}

LeaderboardEntry summarise(const EntryKey& group, const std::string& task, const RowList& rows,
                           const std::map<Counterpart, const EpisodeRow*>& null_rows, double level) {
  LeaderboardEntry entry;
  entry.engine = group.engine;
  entry.controller = group.controller;
  entry.policy = group.policy;
  entry.perturbation = group.perturbation;
  entry.task = task;
  entry.arm = group.arm;
  entry.level = level;
  for (const EpisodeRow* row : rows) count_outcome(*row, entry);
  set_success(rows, entry);
  add_lift(rows, null_rows, entry);
  add_verdicts(rows, entry);
  add_metrics(rows, entry);
  return entry;
}

}  // namespace

std::vector<LeaderboardEntry> leaderboard(const std::vector<EpisodeRow>& rows, const IntervalOptions& options) {
  const RowList sorted = distinct_episodes(rows);
  const std::map<Counterpart, const EpisodeRow*> null_rows = null_arm(sorted);
  std::map<EntryKey, RowList> groups;
  for (const EpisodeRow* row : sorted) {
    RowList& group = groups[{row->engine, row->controller, row->policy, row->perturbation, row->arm}];
    if (!group.empty()) require_distinct(*group.back(), *row);
    group.push_back(row);
  }
  std::vector<LeaderboardEntry> entries;
  for (const auto& [group, members] : groups) {
    std::map<std::pair<int, std::string>, RowList> by_task;
    for (const EpisodeRow* row : members) by_task[{task_rank(row->task), row->task}].push_back(row);
    for (const auto& [task, of_task] : by_task) {
      entries.push_back(summarise(group, task.second, of_task, null_rows, options.level));
    }
    entries.push_back(summarise(group, "all", members, null_rows, options.level));
  }
  return entries;
}

}  // namespace duet
