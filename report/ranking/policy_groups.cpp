#include "duet/report/ranking/policy_groups.h"

#include "duet/rows/groups/row_groups.h"

namespace duet {
namespace {

const Verdict* verdict_of(const EpisodeRow& row, std::string_view version, std::string_view thresholds) {
  for (const Verdict& verdict : row.verdicts)
    if (verdict.version == version && verdict.thresholds == thresholds) return &verdict;
  return nullptr;
}

}  // namespace

std::map<PolicyKey, PerturbedRows> rows_of_policies(const std::vector<EpisodeRow>& rows) {
  std::map<PolicyKey, PerturbedRows> policies;
  for (const EpisodeRow* row : distinct_episodes(rows)) {
    if (row->arm == "null" || row->outcome == Outcome::kUnsupported) continue;
    EpisodeRows& episodes = policies[policy_key(*row)][row->perturbation];
    const auto [found, is_new] = episodes.try_emplace(episode_id(*row), row);
    if (!is_new) require_distinct(*found->second, *row);
  }
  return policies;
}

Rate make_rate(const SuccessByClip& success, double level) {
  if (success.episodes() == 0) return {};
  return {.n = success.episodes(),
          .k = success.successes(),
          .rate = success.mean(),
          .interval = success.of_episodes(level)};
}

Rate headline_rate(const EpisodeRows& rows, double level) {
  SuccessByClip success;
  for (const auto& [id, row] : rows) success.add(id, headline_success(*row) ? 1.0 : 0.0);
  return make_rate(success, level);
}

Rate verdict_rate(const EpisodeRows& rows, std::string_view version, std::string_view thresholds, double level) {
  SuccessByClip success;
  bool known = false;
  for (const auto& [id, row] : rows) {
    const Verdict* verdict = verdict_of(*row, version, thresholds);
    known = known || verdict != nullptr;
    success.add(id, verdict != nullptr && verdict_success(*row, *verdict) ? 1.0 : 0.0);
  }
  return known ? make_rate(success, level) : Rate{};
}

PairedDifference paired_difference(const EpisodeRows& a, const EpisodeRows& b, double level) {
  EpisodePairs pairs;
  for (const auto& [id, row] : a) {
    const auto found = b.find(id);
    if (found != b.end()) pairs.add(*row, *found->second);
  }
  if (pairs.table().pairs() == 0) return {};
  return {
      .pairs = pairs.table().pairs(), .difference = pairs.table().difference(), .interval = pairs.of_episodes(level)};
}

PolicyKey policy_key(const EpisodeRow& row) { return {row.engine, row.controller, row.arm, row.policy}; }

Estimate keys_of(const PolicyKey& key) {
  return {.engine = key.engine, .controller = key.controller, .policy = key.policy, .arm = key.arm};
}

EstimatesOf estimates_of(const PolicyKey& key, Estimates& into) { return {keys_of(key), into}; }

void add_difference(std::string_view name, const PairedDifference& difference, const EstimatesOf& estimates) {
  estimates.add(name, difference.pairs, difference.difference, difference.interval);
}

}  // namespace duet
