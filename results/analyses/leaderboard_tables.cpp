// The leaderboard as Markdown, CSV, LaTeX and JSON.
#include <fmt/format.h>

#include <cmath>
#include <optional>

#include "duet/results/analyses/leaderboard.h"
#include "duet/results/analyses/leaderboard_rows.h"
#include "duet/results/analyses/text_table.h"
#include "duet/results/rows/json_fields.h"

namespace duet {
namespace {

using Entries = std::vector<LeaderboardEntry>;

struct CountColumn {
  const char* title;
  long LeaderboardEntry::*field;
};
constexpr CountColumn kCounts[] = {{"Fell", &LeaderboardEntry::fell},
                                   {"Diverged", &LeaderboardEntry::diverged},
                                   {"Timeout", &LeaderboardEntry::timed_out},
                                   {"Errors", &LeaderboardEntry::errors}};

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

void add_row(const LeaderboardRow& row, const std::vector<std::string>& tasks, bool with_plans,
             std::vector<std::string> cells, TextTable& table) {
  const LeaderboardEntry* overall = row.find("all");
  cells.push_back(overall != nullptr ? fmt::format("{}", overall->n) : "-");
  cells.push_back(success_cell(row, "all"));
  cells.push_back(overall != nullptr ? points(overall->lift, overall->lift_interval) : "-");
  for (const std::string& task : tasks) cells.push_back(success_cell(row, task));
  for (const CountColumn& count : kCounts) {
    cells.push_back(overall != nullptr ? fmt::format("{}", overall->*count.field) : "-");
  }
  if (with_plans) cells.push_back(overall != nullptr ? plans_lost(*overall) : "-");
  table.rows.push_back(std::move(cells));
}

TextTable success_table(const Entries& entries, const std::vector<LeaderboardRow>& rows, const RowLabels& labels) {
  const std::vector<std::string> tasks = leaderboard_tasks(entries);
  TextTable table{.header = labels.columns, .rows = {}, .label_columns = labels.columns.size()};
  for (const char* title : {"n", "Overall", "Lift"}) table.header.emplace_back(title);
  for (const std::string& task : tasks) table.header.push_back(task_heading(rows, task));
  for (const CountColumn& count : kCounts) table.header.emplace_back(count.title);
  const bool with_plans = loses_plans(entries);
  if (with_plans) table.header.emplace_back(kPlansLost);
  for (std::size_t i = 0; i < rows.size(); ++i) add_row(rows[i], tasks, with_plans, labels.cells[i], table);
  return table;
}

TextTable verdict_table(const Entries& entries, const std::vector<LeaderboardRow>& rows, const RowLabels& labels) {
  const std::vector<std::string> names = other_verdicts(entries);
  TextTable table{.header = labels.columns, .rows = {}, .label_columns = labels.columns.size()};
  table.header.insert(table.header.end(), names.begin(), names.end());
  for (std::size_t i = 0; i < rows.size(); ++i) {
    std::vector<std::string> cells = labels.cells[i];
    const LeaderboardEntry* overall = rows[i].find("all");
    for (const std::string& name : names) {
      const bool known = overall != nullptr && overall->other_success.contains(name);
      cells.push_back(known ? percent(overall->other_success.at(name)) : "-");
    }
    table.rows.push_back(std::move(cells));
  }
  return table;
}

// Metrics are rows here: there are many of them and few policies.
TextTable metric_table(const Entries& entries, const std::vector<LeaderboardRow>& rows) {
  const RowLabels labels = row_labels(rows);
  TextTable table{.header = {"Metric"}, .rows = {}, .label_columns = 1};
  for (const std::vector<std::string>& cells : labels.cells) {
    std::string title;
    for (const std::string& cell : cells) title.append(title.empty() ? "" : "/").append(cell);
    table.header.push_back(std::move(title));
  }
  for (const std::string& name : metric_names(entries)) {
    std::vector<std::string> cells = {name};
    for (const LeaderboardRow& row : rows) {
      const LeaderboardEntry* overall = row.find("all");
      const bool known = overall != nullptr && overall->metrics.contains(name);
      cells.push_back(known ? significant(overall->metrics.at(name)) : "-");
    }
    table.rows.push_back(std::move(cells));
  }
  return table;
}

std::vector<std::string> csv_cells(const LeaderboardEntry& entry) {
  return {entry.engine,
          entry.controller,
          entry.policy,
          entry.perturbation,
          entry.arm,
          entry.task,
          fmt::format("{}", entry.n),
          fmt::format("{}", entry.k),
          number_cell(entry.success),
          number_cell(entry.interval.low),
          number_cell(entry.interval.high),
          number_cell(entry.level),
          fmt::format("{}", entry.pairs),
          number_cell(entry.null_success),
          number_cell(entry.lift),
          number_cell(entry.lift_interval.low),
          number_cell(entry.lift_interval.high),
          fmt::format("{}", entry.fell),
          fmt::format("{}", entry.diverged),
          fmt::format("{}", entry.timed_out),
          fmt::format("{}", entry.errors),
          fmt::format("{}", entry.unsupported),
          fmt::format("{}", entry.unjudged),
          fmt::format("{}", entry.plans_late),
          fmt::format("{}", entry.plans_invalid),
          fmt::format("{}", entry.policy_dead)};
}

nlohmann::json json_of(const std::map<std::string, double>& values) {
  nlohmann::json json = nlohmann::json::object();
  for (const auto& [name, value] : values) json[name] = number_or_null(value);
  return json;
}

nlohmann::json json_of(const LeaderboardEntry& entry) {
  return {{"engine", entry.engine},
          {"controller", entry.controller},
          {"policy", entry.policy},
          {"perturbation", entry.perturbation},
          {"arm", entry.arm},
          {"task", entry.task},
          {"n", entry.n},
          {"k", entry.k},
          {"success", number_or_null(entry.success)},
          {"interval", json_of(entry.interval)},
          {"level", entry.level},
          {"pairs", entry.pairs},
          {"null_success", number_or_null(entry.null_success)},
          {"lift", number_or_null(entry.lift)},
          {"lift_interval", json_of(entry.lift_interval)},
          {"other_success", json_of(entry.other_success)},
          {"fell", entry.fell},
          {"diverged", entry.diverged},
          {"timed_out", entry.timed_out},
          {"errors", entry.errors},
          {"unsupported", entry.unsupported},
          {"unjudged", entry.unjudged},
          {"plans_late", entry.plans_late},
          {"plans_invalid", entry.plans_invalid},
          {"policy_dead", entry.policy_dead},
          {"policy_fault", entry.policy_fault},
          {"metrics", json_of(entry.metrics)}};
}

}  // namespace

std::string leaderboard_markdown(const Entries& entries, bool with_metrics) {
  const std::vector<LeaderboardRow> rows = leaderboard_rows(entries);
  const RowLabels labels = row_labels(rows);
  std::string text = labels.caption.empty() ? "" : escape_markdown(labels.caption) + "\n\n";
  if (!rows.empty()) text += markdown_table(success_table(entries, rows, labels)) + "\n";
  for (const std::string& note : leaderboard_notes(entries)) text += escape_markdown(note) + "\n";
  if (!other_verdicts(entries).empty()) {
    text += "\nSuccess in % under each detector version / threshold set, all tasks:\n\n";
    text += markdown_table(verdict_table(entries, rows, labels));
  }
  if (with_metrics && !metric_names(entries).empty()) {
    text += "\nMean over the episodes that have the metric, all tasks:\n\n";
    const std::vector<std::vector<LeaderboardRow>> engines = rows_by_engine(rows);
    for (const std::vector<LeaderboardRow>& of_engine : engines) {
      if (engines.size() > 1)
        text += fmt::format("{}Engine {}:\n\n", &of_engine == &engines.front() ? "" : "\n",
                            escape_markdown(of_engine.front().engine));
      text += markdown_table(metric_table(entries, of_engine));
    }
  }
  return text;
}

std::string leaderboard_csv(const Entries& entries) {
  TextTable table;
  table.header = {"engine",      "controller", "policy",     "perturbation",  "arm",        "task",      "n",
                  "k",           "success",    "ci_low",     "ci_high",       "level",      "pairs",     "null_success",
                  "lift",        "lift_low",   "lift_high",  "fell",          "diverged",   "timed_out", "errors",
                  "unsupported", "unjudged",   "plans_late", "plans_invalid", "policy_dead"};
  const std::vector<std::string> verdicts = other_verdicts(entries);
  const std::vector<std::string> metrics = metric_names(entries);
  for (const std::string& name : verdicts) table.header.push_back(fmt::format("success:{}", name));
  for (const std::string& name : metrics) table.header.push_back(fmt::format("metric:{}", name));
  const auto cell = [](const std::map<std::string, double>& values, const std::string& name) {
    const auto found = values.find(name);
    return found == values.end() ? std::string() : number_cell(found->second);
  };
  for (const LeaderboardEntry& entry : entries) {
    std::vector<std::string> cells = csv_cells(entry);
    for (const std::string& name : verdicts) cells.push_back(cell(entry.other_success, name));
    for (const std::string& name : metrics) cells.push_back(cell(entry.metrics, name));
    table.rows.push_back(std::move(cells));
  }
  return csv_table(table);
}

std::string leaderboard_latex(const Entries& entries) {
  const std::vector<LeaderboardRow> rows = leaderboard_rows(entries);
  const RowLabels labels = row_labels(rows);
  std::string text = "% \\usepackage{booktabs}\n";
  for (const std::string& note : leaderboard_notes(entries)) text += latex_comment(note);
  if (!labels.caption.empty()) text += latex_comment(labels.caption);
  return text + latex_table(success_table(entries, rows, labels));
}

nlohmann::json leaderboard_json(const Entries& entries) {
  nlohmann::json list = nlohmann::json::array();
  for (const LeaderboardEntry& entry : entries) list.push_back(json_of(entry));
  return {{"schema", "duet.leaderboard/1"}, {"entries", std::move(list)}};
}

}  // namespace duet
