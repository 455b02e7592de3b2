// The leaderboard as tables and figures.
#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <optional>
#include <set>

#include "duet/report/ranking/leaderboard.h"
#include "duet/report/ranking/leaderboard_rows.h"

namespace duet {
namespace {

using Entries = std::vector<LeaderboardEntry>;

struct CountColumn {
  const char* title;  // "" for one that is in no table
  const char* name;   // of its figure
  long LeaderboardEntry::*field;
};
constexpr CountColumn kCounts[] = {{"Fell", "fell", &LeaderboardEntry::fell},
                                   {"Diverged", "diverged", &LeaderboardEntry::diverged},
                                   {"Timeout", "timed_out", &LeaderboardEntry::timed_out},
                                   {"Errors", "errors", &LeaderboardEntry::errors},
                                   {"", "unsupported", &LeaderboardEntry::unsupported},
                                   {"", "unjudged", &LeaderboardEntry::unjudged},
                                   {"", "plans_late", &LeaderboardEntry::plans_late},
                                   {"", "plans_invalid", &LeaderboardEntry::plans_invalid},
                                   {"", "policy_dead", &LeaderboardEntry::policy_dead}};

// "Hug (15)" where all rows have as many episodes.
std::string task_heading(const std::vector<LeaderboardRow>& rows, const std::string& task) {
  std::optional<long> n;
  for (const LeaderboardRow& row : rows) {
    const LeaderboardEntry* entry = row.find(task);
    if (entry == nullptr || (n.has_value() && *n != entry->n)) return task_title(task);
    n = entry->n;
  }
  return n.has_value() ? fmt::format("{} ({})", task_title(task), *n) : task_title(task);
}

std::string success_cell(const LeaderboardRow& row, const std::string& task) {
  const LeaderboardEntry* entry = row.find(task);
  return entry != nullptr ? percent(entry->success, entry->interval) : "-";
}

TitledTable board_table(const Entries& entries, const std::vector<LeaderboardRow>& rows, const RowLabels& labels) {
  TitledTable titled = labelled_table("", labels);
  // Adds a column of the entry over all tasks.
  const auto add = [&](const char* title, const auto& cell) {
    add_column(title, titled, [&](std::size_t i) {
      const LeaderboardEntry* overall = rows[i].find("all");
      return overall != nullptr ? cell(*overall) : "-";
    });
  };
  add("n", [](const LeaderboardEntry& entry) { return count_cell(entry.n); });
  add("Overall", [](const LeaderboardEntry& entry) { return percent(entry.success, entry.interval); });
  add("Lift", [](const LeaderboardEntry& entry) { return points(entry.lift, entry.lift_interval); });
  for (const std::string& task : leaderboard_tasks(entries))
    add_column(task_heading(rows, task), titled, [&](std::size_t i) { return success_cell(rows[i], task); });
  for (const CountColumn& count : kCounts)
    if (*count.title != '\0')
      add(count.title, [&](const LeaderboardEntry& entry) { return count_cell(entry.*count.field); });
  if (loses_plans(entries)) add(kPlansLost, plans_lost);
  titled.notes = leaderboard_notes(entries);
  return titled;
}

TitledTable verdict_table(const Entries& entries, const std::vector<LeaderboardRow>& rows, const RowLabels& labels) {
  TitledTable titled = labelled_table("", labels);
  titled.caption = "Success in % under each detector version / threshold set, all tasks:";
  for (const std::string& name : other_verdicts(entries)) {
    add_column(name, titled, [&](std::size_t i) {
      const LeaderboardEntry* overall = rows[i].find("all");
      const bool known = overall != nullptr && overall->other_success.contains(name);
      return known ? percent(overall->other_success.at(name)) : "-";
    });
  }
  return titled;
}

// Metrics are rows here: there are many of them and few policies. `engine`: "" where there is one only.
TitledTable metric_table(const Entries& entries, const std::vector<LeaderboardRow>& rows, const std::string& engine) {
  TitledTable titled{.caption = fmt::format("Mean over the episodes that have the metric, all tasks{}:",
                                            engine.empty() ? "" : ", engine " + engine),
                     .table = {.header = {"Metric"}}};
  for (const std::string& name : metric_names(entries)) titled.table.rows.push_back({name});
  const RowLabels labels = row_labels(rows);
  for (std::size_t i = 0; i < rows.size(); ++i) {
    const LeaderboardEntry* overall = rows[i].find("all");
    add_column(fmt::format("{}", fmt::join(labels.cells[i], "/")), titled, [&](std::size_t metric) {
      const std::string& name = titled.table.rows[metric].front();
      const bool known = overall != nullptr && overall->metrics.contains(name);
      return known ? significant(overall->metrics.at(name)) : "-";
    });
  }
  return titled;
}

bool has_several_engines(const Entries& entries) {
  std::set<std::string_view> engines;
  for (const LeaderboardEntry& entry : entries) engines.insert(entry.engine);
  engines.erase(kPlaybackEngine);
  return engines.size() > 1;
}

std::string unit_of_metric(const std::vector<MetricColumn>& columns, const std::string& metric) {
  const auto found = std::ranges::find(columns, metric, &MetricColumn::name);
  return found == columns.end() ? "" : found->unit;
}

void add_entry_figures(const LeaderboardEntry& entry, const std::vector<MetricColumn>& columns, bool with_metrics,
                       std::vector<Estimate>& into) {
  EstimatesOf figures{{.engine = entry.engine,
                       .controller = entry.controller,
                       .policy = entry.policy,
                       .arm = entry.arm,
                       .perturbation = entry.perturbation,
                       .task = entry.task},
                      into};
  figures.rate("success", {entry.n, entry.k, entry.success, entry.interval});
  figures.add("null_success", entry.pairs, entry.null_success);
  figures.add("lift", entry.pairs, entry.lift, entry.lift_interval);
  for (const CountColumn& count : kCounts) figures.count(count.name, entry.n, entry.*count.field);
  if (!entry.policy_fault.empty()) figures.word("policy_fault", entry.policy_fault);
  if (with_metrics)
    for (const auto& [name, mean] : entry.metrics)
      figures.add(name, {}, mean, kNoInterval, unit_of_metric(columns, name));
  for (const auto& [detector, rate] : entry.other_success) {
    figures.keys.of = detector;
    figures.add("success", entry.n, rate);
  }
}

}  // namespace

Analysis leaderboard_analysis(const Entries& entries, const std::vector<MetricColumn>& columns, bool with_metrics) {
  Analysis analysis{.name = kLeaderboardName, .title = "Every engine and task"};
  for (const LeaderboardEntry& entry : entries) add_entry_figures(entry, columns, with_metrics, analysis.estimates);
  const std::vector<LeaderboardRow> rows = leaderboard_rows(entries);
  if (rows.empty()) {
    analysis.notes = leaderboard_notes(entries);
    return analysis;
  }
  analysis.level = entries.front().level;
  const RowLabels labels = row_labels(rows);
  analysis.tables = {board_table(entries, rows, labels)};
  if (!other_verdicts(entries).empty()) analysis.tables.push_back(verdict_table(entries, rows, labels));
  if (!with_metrics || metric_names(entries).empty()) return analysis;
  const std::vector<std::vector<LeaderboardRow>> engines = rows_by_engine(rows);
  for (const std::vector<LeaderboardRow>& of_engine : engines) {
    analysis.tables.push_back(metric_table(entries, of_engine, engines.size() > 1 ? of_engine.front().engine : ""));
    analysis.tables.back().too_long_for_terminal = has_several_engines(entries);
  }
  return analysis;
}

}  // namespace duet
