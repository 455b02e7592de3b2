#include "duet/results/analyses/policy_groups.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "duet/results/rows/distinct_episodes.h"
#include "duet/results/rows/json_fields.h"

namespace duet {
namespace {

bool ended(const EpisodeRow& row) { return row.outcome == Outcome::kOk || row.outcome == Outcome::kFell; }

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

Rate make_rate(long k, long n, double level) {
  if (n == 0) return {};
  return {.n = n, .k = k, .rate = static_cast<double>(k) / static_cast<double>(n), .interval = wilson(k, n, level)};
}

Rate headline_rate(const EpisodeRows& rows, double level) {
  long k = 0;
  for (const auto& [id, row] : rows) k += headline_success(*row) ? 1 : 0;
  return make_rate(k, static_cast<long>(rows.size()), level);
}

Rate verdict_rate(const EpisodeRows& rows, std::string_view version, std::string_view thresholds, double level) {
  long k = 0;
  bool known = false;
  for (const auto& [id, row] : rows) {
    const Verdict* verdict = verdict_of(*row, version, thresholds);
    if (verdict == nullptr) continue;
    known = true;
    if (ended(*row) && verdict->success) ++k;
  }
  return known ? make_rate(k, static_cast<long>(rows.size()), level) : Rate{};
}

PairedDifference paired_difference(const EpisodeRows& a, const EpisodeRows& b, double level) {
  PairedTable table;
  for (const auto& [id, row] : a) {
    const auto found = b.find(id);
    if (found != b.end()) table.add(headline_success(*row), headline_success(*found->second));
  }
  if (table.pairs() == 0) return {};
  return {.pairs = table.pairs(),
          .difference = table.difference(),
          .interval = newcombe_paired(table.both, table.only_a, table.only_b, table.neither, level)};
}

RowLabels policy_labels(const std::vector<PolicyKey>& keys) {
  RowLabels labels;
  labels.cells.resize(keys.size());
  const auto add = [&](const char* title, std::string PolicyKey::*field) {
    if (std::all_of(keys.begin(), keys.end(),
                    [&](const PolicyKey& key) { return key.*field == keys.front().*field; })) {
      if (!keys.empty() && !(keys.front().*field).empty())
        labels.caption += fmt::format("{}{} {}.", labels.caption.empty() ? "" : " ", title, keys.front().*field);
      return;
    }
    labels.columns.emplace_back(title);
    for (std::size_t i = 0; i < keys.size(); ++i) labels.cells[i].push_back(keys[i].*field);
  };
  add("Engine", &PolicyKey::engine);
  add("Controller", &PolicyKey::controller);
  labels.columns.emplace_back("Policy");
  for (std::size_t i = 0; i < keys.size(); ++i) labels.cells[i].push_back(policy_name(keys[i]));
  return labels;
}

TitledTable labelled_table(const std::string& title, const RowLabels& labels) {
  return {.title = title,
          .caption = labels.caption,
          .table = {.header = labels.columns, .rows = labels.cells, .label_columns = labels.columns.size()},
          .notes = {}};
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

std::string tables_markdown(const std::vector<TitledTable>& tables) {
  std::string text;
  for (const TitledTable& titled : tables) text.append(text.empty() ? "" : "\n").append(markdown_of(titled));
  return text;
}

std::string tables_latex(const std::vector<TitledTable>& tables) {
  std::string text = "% \\usepackage{booktabs}\n";
  for (const TitledTable& titled : tables) text.append("\n").append(latex_of(titled));
  return text;
}

TextTable figure_lines(const std::string& about) {
  TextTable lines;
  lines.header = {"source", "engine", "controller", "arm",    "policy", about,
                  "figure", "n",      "value",      "ci_low", "ci_high"};
  return lines;
}

void add_figure_line(const char* source, const PolicyKey& key, const std::string& about, std::string_view figure,
                     long n, double value, const Interval& interval, TextTable& lines) {
  lines.rows.push_back({source, key.engine, key.controller, key.arm, key.policy, about, std::string(figure),
                        fmt::format("{}", n), number_cell(value), number_cell(interval.low),
                        number_cell(interval.high)});
}

nlohmann::json json_of(const Rate& rate) {
  return {{"n", rate.n}, {"k", rate.k}, {"rate", number_or_null(rate.rate)}, {"interval", json_of(rate.interval)}};
}

nlohmann::json json_of(const PolicyKey& key) {
  return {{"engine", key.engine}, {"controller", key.controller}, {"arm", key.arm}, {"policy", key.policy}};
}

}  // namespace duet
