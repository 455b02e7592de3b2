#include "duet/report/ranking/policy_groups.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "duet/rows/groups/distinct_episodes.h"

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
    EpisodeRows& episodes = policies[{row->engine, row->controller, row->arm, row->policy}][row->perturbation];
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

RowLabels policy_labels(const std::vector<PolicyKey>& keys) {
  LabelColumn names{"Policy", {}, true};
  for (const PolicyKey& key : keys) names.values.push_back(policy_name(key));
  return row_labels({label_column("Engine", keys, &PolicyKey::engine),
                     label_column("Controller", keys, &PolicyKey::controller), names});
}

std::vector<std::string>& add_paper_row(const std::string& name, TitledTable& titled) {
  std::vector<std::string>& cells = titled.table.rows.emplace_back(titled.table.label_columns, "-");
  cells.back() = fmt::format("{} (the paper's)", name);
  return cells;
}

std::string policy_name(const PolicyKey& key) {
  return key.arm == "main" ? key.policy : fmt::format("{} ({} arm)", key.policy, key.arm);
}

std::string rate_cell(const Rate& rate) { return percent(rate.rate, rate.interval); }

FiguresOf figures_of(const PolicyKey& key, std::vector<Figure>& into) {
  return {{.engine = key.engine, .controller = key.controller, .policy = key.policy, .arm = key.arm}, into};
}

FiguresOf paper_figures_of(std::string_view policy, std::vector<Figure>& into) {
  return {{.source = "paper", .policy = std::string(policy)}, into};
}

void add_difference(std::string_view name, const PairedDifference& difference, const FiguresOf& figures) {
  figures.add(name, difference.pairs, difference.difference, difference.interval);
}

}  // namespace duet
