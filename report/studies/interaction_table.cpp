#include "duet/report/studies/interaction_table.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <iterator>

#include "duet/report/tables/cells.h"
#include "duet/rows/groups/distinct_episodes.h"

namespace duet {
namespace {

constexpr const char* kEveryTask = "all";

const Verdict* rule_verdict(const EpisodeRow& row) {
  const auto found = std::ranges::find(row.verdicts, "interaction", &Verdict::version);
  return found == row.verdicts.end() ? nullptr : &*found;
}

// "judged" stands in the parts of an episode that the rule cannot judge.
bool is_judged(const Verdict* verdict) { return verdict != nullptr && !verdict->parts.contains("judged"); }

void count_episode(const EpisodeRow& row, InteractionEntry& entry) {
  const Verdict* verdict = rule_verdict(row);
  entry.fell += row.fell ? 1 : 0;
  if (const std::optional<double> lead = lead_of(row)) {
    ++entry.led;
    entry.false_starts += *lead > kFalseStart ? 1 : 0;
  }
  if (!is_judged(verdict)) {
    ++entry.unjudged;
    return;
  }
  for (const auto& [part, holds] : verdict->parts) entry.failed[part] += holds ? 0 : 1;
}

InteractionEntry interaction_entry(const PolicyKey& key, const std::string& task, const EpisodeRows& rows,
                                   double level) {
  InteractionEntry entry{.key = key, .task = task, .success = {}, .before = {}, .failed = {}};
  SuccessByClip success;
  for (const auto& [id, row] : rows) {
    const Verdict* verdict = rule_verdict(*row);
    success.add(id, verdict != nullptr && verdict_success(*row, *verdict) ? 1.0 : 0.0);
    count_episode(*row, entry);
  }
  entry.success = make_rate(success, level);
  entry.before = verdict_rate(rows, "robot", "paper", level);
  return entry;
}

std::vector<InteractionEntry> entries_of(const PolicyKey& key, const EpisodeRows& rows, double level) {
  std::map<std::pair<int, std::string>, EpisodeRows> tasks;
  for (const auto& [id, row] : rows) tasks[{task_rank(id.task), id.task}].emplace(id, row);
  std::vector<InteractionEntry> entries = {interaction_entry(key, kEveryTask, rows, level)};
  for (const auto& [task, of] : tasks) entries.push_back(interaction_entry(key, task.second, of, level));
  return entries;
}

std::string share_of(long k, long n) { return n == 0 ? "-" : fmt::format("{}/{}", k, n); }

// Entries of all tasks, and of each the tasks that follow it.
struct ArmEntries {
  const InteractionEntry* all = nullptr;
  std::map<std::string, const InteractionEntry*> tasks = {};
};

std::vector<ArmEntries> arms_of(const InteractionTable& table) {
  std::vector<ArmEntries> arms;
  for (const InteractionEntry& entry : table.entries) {
    if (entry.task == kEveryTask)
      arms.push_back({.all = &entry});
    else
      arms.back().tasks[entry.task] = &entry;
  }
  return arms;
}

std::vector<std::string> tasks_in(const InteractionTable& table) {
  std::vector<std::string> tasks;
  for (const InteractionEntry& entry : table.entries)
    if (entry.task != kEveryTask && std::ranges::find(tasks, entry.task) == tasks.end()) tasks.push_back(entry.task);
  std::ranges::sort(tasks, {}, [](const std::string& task) { return std::pair(task_rank(task), task); });
  return tasks;
}

TitledTable success_rows(const InteractionTable& table) {
  const std::vector<ArmEntries> arms = arms_of(table);
  const std::vector<std::string> tasks = tasks_in(table);
  std::vector<PolicyKey> keys;
  keys.reserve(arms.size());
  for (const ArmEntries& arm : arms) keys.push_back(arm.all->key);
  TitledTable titled = labelled_table("Success is the interaction", policy_labels(keys));
  titled.table.header.insert(titled.table.header.end(), {"n", "Success [%]"});
  for (const std::string& task : tasks) titled.table.header.push_back(task_title(task));
  titled.table.header.insert(titled.table.header.end(), {"robot/paper [%]", "False starts", "Fell", "Not judged"});
  for (std::size_t i = 0; i < arms.size(); ++i) {
    const InteractionEntry& all = *arms[i].all;
    std::vector<std::string>& cells = titled.table.rows[i];
    cells.insert(cells.end(), {count_cell(all.success.n), rate_cell(all.success)});
    for (const std::string& task : tasks) {
      const auto found = arms[i].tasks.find(task);
      cells.push_back(found == arms[i].tasks.end() ? "-"
                                                   : share_of(found->second->success.k, found->second->success.n));
    }
    cells.insert(cells.end(), {rate_cell(all.before), share_of(all.false_starts, all.led), count_cell(all.fell),
                               count_cell(all.unjudged)});
  }
  titled.notes = {fmt::format(
      "Success under the rule interaction with {:g} % Wilson intervals, and under the detectors robot/paper that ask "
      "for "
      "less. False starts: the robot begins more than {:g} s before its partner, withdrawn beginnings included, of the "
      "episodes in which both begin; nobody waits in a hug.",
      100.0 * table.level, kFalseStart)};
  return titled;
}

// Episodes that fail a condition; "-" for one that none was asked.
std::string failed_cell(const InteractionEntry& entry, const char* part) {
  const auto found = entry.failed.find(part);
  return found == entry.failed.end() ? "-" : count_cell(found->second);
}

TitledTable condition_rows(const InteractionTable& table) {
  TitledTable titled = labelled_table("What failed episodes lack", labels_of(table.entries));
  titled.table.header.insert(titled.table.header.end(), {"Task", "n", "Succeeded"});
  ++titled.table.label_columns;
  for (const char* part : kInteractionParts) titled.table.header.emplace_back(part);
  titled.table.header.insert(titled.table.header.end(), {"False starts", "Not judged"});
  for (std::size_t i = 0; i < table.entries.size(); ++i) {
    const InteractionEntry& entry = table.entries[i];
    std::vector<std::string>& cells = titled.table.rows[i];
    cells.insert(cells.end(), {task_title(entry.task), count_cell(entry.success.n), count_cell(entry.success.k)});
    for (const char* part : kInteractionParts) cells.push_back(failed_cell(entry, part));
    cells.insert(cells.end(), {share_of(entry.false_starts, entry.led), count_cell(entry.unjudged)});
  }
  titled.notes = {
      "Episodes that do not meet a condition of the rule; one may lack several. \"-\": asked of none (body: where the "
      "partner is a ghost)."};
  titled.too_long_for_terminal = true;
  return titled;
}

void add_interaction_figures(const InteractionEntry& entry, std::vector<Figure>& into) {
  FiguresOf figures = figures_of(entry.key, into);
  figures.keys.task = entry.task;
  figures.rate("success", entry.success);
  figures.count("fell", entry.success.n, entry.fell);
  figures.count("not_judged", entry.success.n, entry.unjudged);
  figures.count("false_starts", entry.led, entry.false_starts);
  for (const auto& [part, count] : entry.failed) {
    figures.keys.of = part;
    figures.count("failed", entry.success.n - entry.unjudged, count);
  }
  figures.keys.of = "robot/paper";
  if (entry.before.n > 0) figures.rate("success", entry.before);
}

}  // namespace

std::optional<double> lead_of(const EpisodeRow& row) {
  if (const Verdict* verdict = rule_verdict(row)) {
    const auto lead = verdict->values.find("lead_s");
    return lead != verdict->values.end() && std::isfinite(lead->second) ? std::optional(lead->second) : std::nullopt;
  }
  const auto own = row.metrics.find("onset_s"), partner = row.metrics.find("partner_onset_s");
  if (own == row.metrics.end() || partner == row.metrics.end()) return std::nullopt;
  const double lead = partner->second - own->second;
  return std::isfinite(lead) ? std::optional(lead) : std::nullopt;
}

InteractionTable interaction_table(const std::vector<EpisodeRow>& rows, double level) {
  std::map<PolicyKey, EpisodeRows> arms;
  bool judged = false;
  for (const EpisodeRow* row : distinct_episodes(rows)) {
    if (row->perturbation != kClean || row->outcome == Outcome::kUnsupported) continue;
    judged = judged || rule_verdict(*row) != nullptr;
    const auto [found, is_new] =
        arms[{row->engine, row->controller, row->arm, row->policy}].try_emplace(episode_id(*row), row);
    if (!is_new) require_distinct(*found->second, *row);
  }
  InteractionTable table{.level = level, .entries = {}};
  if (!judged) return table;
  std::vector<std::vector<InteractionEntry>> found;
  found.reserve(arms.size());
  for (const auto& [key, episodes] : arms) found.push_back(entries_of(key, episodes, level));
  std::stable_sort(found.begin(), found.end(),
                   [](const auto& a, const auto& b) { return a.front().success.rate > b.front().success.rate; });
  for (std::vector<InteractionEntry>& entries : found) std::ranges::move(entries, std::back_inserter(table.entries));
  return table;
}

Analysis interaction_analysis(const InteractionTable& table) {
  Analysis analysis{.name = "interaction", .title = "The rule interaction", .level = table.level};
  if (table.entries.empty()) {
    analysis.notes = {"No episode was judged by the rule interaction."};
    return analysis;
  }
  analysis.tables = {success_rows(table), condition_rows(table)};
  for (const InteractionEntry& entry : table.entries) add_interaction_figures(entry, analysis.figures);
  return analysis;
}

}  // namespace duet
