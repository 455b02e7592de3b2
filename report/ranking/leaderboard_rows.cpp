#include "duet/report/ranking/leaderboard_rows.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <optional>
#include <set>
#include <tuple>

#include "duet/core/require.h"
#include "duet/core/task.h"
#include "duet/report/ranking/leaderboard.h"
#include "duet/rows/groups/row_groups.h"

namespace duet {
namespace {

constexpr std::size_t kLongestFault = 240;  // of a policy's message in a note [bytes]

int arm_rank(const std::string& arm) { return arm == "main" ? 0 : arm == "null" ? 2 : 1; }

auto place(const LeaderboardRow& row) {
  return std::make_tuple(row.engine, row.controller, row.perturbation, arm_rank(row.arm), row.policy, row.arm);
}

std::string policy_label(const LeaderboardRow& row) {
  if (row.arm == "main") return row.policy;
  return row.policy == row.arm ? fmt::format("{} (control)", row.arm) : fmt::format("{} ({} arm)", row.policy, row.arm);
}

std::string joined(const std::vector<std::string>& words, const char* separator) {
  std::string text;
  for (const std::string& word : words) text.append(text.empty() ? "" : separator).append(word);
  return text;
}

std::string small_sample_note(const std::vector<LeaderboardEntry>& entries) {
  std::set<std::pair<int, std::string>> small;
  for (const LeaderboardEntry& entry : entries) {
    if (entry.n < kFewestClips) small.emplace(task_rank(entry.task), task_title(entry.task));
  }
  if (small.empty()) return "";
  std::vector<std::string> titles;
  titles.reserve(small.size());
  for (const auto& [rank, title] : small) titles.push_back(title);
  return fmt::format("Fewer than {} episodes: {}. Read those figures with their intervals; do not rank by them.",
                     kFewestClips, joined(titles, ", "));
}

// Sum over the entries that cover all tasks.
long total(const std::vector<LeaderboardEntry>& entries, long LeaderboardEntry::*field) {
  long sum = 0;
  for (const LeaderboardEntry& entry : entries) {
    if (entry.task == "all") sum += entry.*field;
  }
  return sum;
}

bool loses_plans(const LeaderboardEntry& entry) {
  return entry.plans_late > 0 || entry.plans_invalid > 0 || entry.policy_dead > 0;
}

std::string null_arm_note(const std::vector<LeaderboardEntry>& entries) {
  long main = 0;
  long paired = 0;
  for (const LeaderboardEntry& entry : entries) {
    if (entry.task != "all" || entry.arm == "null") continue;
    main += entry.n;
    paired += entry.pairs;
  }
  if (main == 0 || paired == main) return "";
  if (paired == 0) return "The null arm was not run: success alone does not show that the robot took part.";
  return fmt::format("Lift covers the {} of {} episodes that the null arm has too.", paired, main);
}

}  // namespace

const LeaderboardEntry* LeaderboardRow::find(const std::string& task) const {
  const auto found = by_task.find(task);
  return found == by_task.end() ? nullptr : found->second;
}

std::vector<LeaderboardRow> leaderboard_rows(const std::vector<LeaderboardEntry>& entries) {
  std::vector<LeaderboardRow> rows;
  for (const LeaderboardEntry& entry : entries) {
    LeaderboardRow row{.engine = entry.engine,
                       .controller = entry.controller,
                       .policy = entry.policy,
                       .perturbation = entry.perturbation,
                       .arm = entry.arm,
                       .by_task = {}};
    auto found =
        std::find_if(rows.begin(), rows.end(), [&](const LeaderboardRow& other) { return place(other) == place(row); });
    if (found == rows.end()) found = rows.insert(rows.end(), std::move(row));
    found->by_task[entry.task] = &entry;
  }
  std::stable_sort(rows.begin(), rows.end(),
                   [](const LeaderboardRow& a, const LeaderboardRow& b) { return place(a) < place(b); });
  return rows;
}

std::vector<std::vector<LeaderboardRow>> rows_by_engine(const std::vector<LeaderboardRow>& rows) {
  std::vector<std::vector<LeaderboardRow>> engines;
  for (const LeaderboardRow& row : rows) {
    if (engines.empty() || engines.back().front().engine != row.engine) engines.emplace_back();
    engines.back().push_back(row);
  }
  return engines;
}

std::vector<std::string> leaderboard_tasks(const std::vector<LeaderboardEntry>& entries) {
  std::set<std::pair<int, std::string>> ranked;
  for (const LeaderboardEntry& entry : entries) {
    if (entry.task != "all") ranked.emplace(task_rank(entry.task), entry.task);
  }
  std::vector<std::string> tasks;
  tasks.reserve(ranked.size());
  for (const auto& [rank, task] : ranked) tasks.push_back(task);
  return tasks;
}

std::vector<std::string> other_verdicts(const std::vector<LeaderboardEntry>& entries) {
  std::set<std::string> names;
  for (const LeaderboardEntry& entry : entries) {
    for (const auto& [name, rate] : entry.other_success) names.insert(name);
  }
  return {names.begin(), names.end()};
}

std::vector<std::string> metric_names(const std::vector<LeaderboardEntry>& entries) {
  std::set<std::string> names;
  for (const LeaderboardEntry& entry : entries) {
    for (const auto& [name, mean] : entry.metrics) names.insert(name);
  }
  return {names.begin(), names.end()};
}

RowLabels row_labels(const std::vector<LeaderboardRow>& rows) {
  LabelColumn policies{"Policy", {}, true};
  for (const LeaderboardRow& row : rows) policies.values.push_back(policy_label(row));
  return row_labels({label_column("Engine", rows, &LeaderboardRow::engine),
                     label_column("Controller", rows, &LeaderboardRow::controller),
                     label_column("Perturbation", rows, &LeaderboardRow::perturbation), policies});
}

std::vector<std::string> leaderboard_notes(const std::vector<LeaderboardEntry>& entries) {
  if (entries.empty()) return {"No episodes."};
  std::vector<std::string> notes = {
      fmt::format("Success in % of episodes with {:g} % Wilson intervals; \"Overall\" is the micro average. Lift is "
                  "success minus that "
                  "of the same episodes under the null arm (a robot that stands still), in points, with Newcombe's "
                  "paired interval. "
                  "Episodes that fell, diverged, timed out or ended in an error count as failures, under every "
                  "detector.",
                  100.0 * entries.front().level)};
  if (std::ranges::any_of(entries, &LeaderboardEntry::by_clip))
    notes.emplace_back(
        "Clips have several episodes (draws, or both roles), which are not independent: intervals are by clip, and "
        "none "
        "is narrower than one episode a clip would give.");
  for (std::string note : {small_sample_note(entries), null_arm_note(entries)}) {
    if (!note.empty()) notes.push_back(std::move(note));
  }
  if (const long count = total(entries, &LeaderboardEntry::unsupported); count > 0) {
    notes.push_back(fmt::format("{} episodes were not supported by their engine and count as failures.", count));
  }
  if (const long count = total(entries, &LeaderboardEntry::unjudged); count > 0) {
    notes.push_back(fmt::format("{} episodes have no headline verdict and count as failures.", count));
  }
  for (std::string& note : policy_fault_notes(entries)) notes.push_back(std::move(note));
  return notes;
}

bool loses_plans(const std::vector<LeaderboardEntry>& entries) {
  return std::any_of(entries.begin(), entries.end(), [](const LeaderboardEntry& entry) { return loses_plans(entry); });
}

std::string plans_lost(const LeaderboardEntry& entry) {
  std::vector<std::string> parts;
  if (entry.plans_late > 0) parts.push_back(fmt::format("{} late", entry.plans_late));
  if (entry.plans_invalid > 0) parts.push_back(fmt::format("{} invalid", entry.plans_invalid));
  if (entry.policy_dead > 0) parts.push_back(fmt::format("dead in {}", entry.policy_dead));
  return parts.empty() ? "0" : joined(parts, ", ");
}

std::vector<std::string> policy_fault_notes(const std::vector<LeaderboardEntry>& entries) {
  std::map<std::string, LeaderboardEntry> policies;  // sums over engines, controllers, perturbations and arms
  for (const LeaderboardEntry& entry : entries) {
    if (entry.task != "all" || !loses_plans(entry)) continue;
    LeaderboardEntry& sum = policies[entry.policy];
    for (const auto field : {&LeaderboardEntry::n, &LeaderboardEntry::plans_late, &LeaderboardEntry::plans_invalid,
                             &LeaderboardEntry::policy_dead})
      sum.*field += entry.*field;
    if (sum.policy_fault.empty()) sum.policy_fault = entry.policy_fault;
  }
  std::vector<std::string> notes;
  for (const auto& [name, sum] : policies) {
    const char* dead = sum.policy_dead > 0 ? ", which are errors and count as failures" : "";
    notes.push_back(fmt::format("Policy '{}' lost plans (in {} episodes: {}{}). The first fault: {}", excerpt(name),
                                sum.n, plans_lost(sum), dead, excerpt(sum.policy_fault, kLongestFault)));
  }
  return notes;
}

// The leaderboard as tables and figures.

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
