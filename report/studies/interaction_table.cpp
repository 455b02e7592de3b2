#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <set>

#include "duet/core/task.h"
#include "duet/report/ranking/policy_groups.h"
#include "duet/report/studies/studies.h"
#include "duet/rows/groups/row_groups.h"

namespace duet {
namespace {

constexpr const char* kEveryTask = "all";
// The conditions in the order of the table, as the rule's verdict calls them.
constexpr std::array<const char*, 7> kInteractionParts = {"act", "alone", "touch", "force", "body", "reply", "stands"};

const Verdict* rule_verdict(const EpisodeRow& row) {
  const auto found = std::ranges::find(row.verdicts, "interaction", &Verdict::version);
  return found == row.verdicts.end() ? nullptr : &*found;
}

// "judged" stands in the parts of an episode that the rule cannot judge.
bool is_judged(const Verdict* verdict) { return verdict != nullptr && !verdict->parts.contains("judged"); }

// Success under the rule and under robot/paper; for each condition the episodes that it was asked of and that do not
// meet it.
void add_task(const std::string& task, const EpisodeRows& rows, double level, EstimatesOf of) {
  SuccessByClip success;
  std::map<std::string, long> failed;
  long fell = 0, unjudged = 0, led = 0, false_starts = 0;
  for (const auto& [id, row] : rows) {
    const Verdict* verdict = rule_verdict(*row);
    success.add(id, verdict != nullptr && verdict_success(*row, *verdict) ? 1.0 : 0.0);
    fell += row->fell ? 1 : 0;
    if (const std::optional<double> lead = lead_of(*row)) {
      ++led;
      false_starts += *lead > kFalseStart ? 1 : 0;
    }
    unjudged += is_judged(verdict) ? 0 : 1;
    if (is_judged(verdict))
      for (const auto& [part, holds] : verdict->parts) failed[part] += holds ? 0 : 1;
  }
  const long n = success.episodes();
  of.keys.task = task;
  of.rate("success", make_rate(success, level));
  of.count("fell", n, fell);
  of.count("not_judged", n, unjudged);
  of.count("false_starts", led, false_starts);
  for (const auto& [part, count] : failed) {
    of.keys.of = part;
    of.count("failed", n - unjudged, count);
  }
  of.keys.of = "robot/paper";
  if (const Rate before = verdict_rate(rows, "robot", "paper", level); before.n > 0) of.rate("success", before);
}

// All tasks and then every one.
Estimates arm_estimates(const PolicyKey& key, const EpisodeRows& rows, double level) {
  std::map<std::pair<int, std::string>, EpisodeRows> tasks;
  for (const auto& [id, row] : rows) tasks[{task_rank(id.task), id.task}].emplace(id, row);
  Estimates estimates;
  add_task(kEveryTask, rows, level, estimates_of(key, estimates));
  for (const auto& [task, of] : tasks) add_task(task.second, of, level, estimates_of(key, estimates));
  return estimates;
}

TitledTable success_table(const Estimates& estimates, double level) {
  std::vector<std::string> tasks = values_of(estimates, &Estimate::task);
  std::erase(tasks, kEveryTask);
  std::ranges::sort(tasks, {}, [](const std::string& task) { return std::pair(task_rank(task), task); });
  const Estimate success{.task = kEveryTask, .name = "success"};
  Pivot pivot{.title = "Success is the interaction",
              .rows = policy_rows(),
              .columns = {column("n", success, as_n), column("Success [%]", success, as_percent)}};
  for (const std::string& task : tasks)
    pivot.columns.push_back(column(task_title(task), {.task = task, .name = "success"}, as_k_of_n));
  pivot.columns.insert(
      pivot.columns.end(),
      {column("robot/paper [%]", {.task = kEveryTask, .of = "robot/paper", .name = "success"}, as_percent),
       column("False starts", {.task = kEveryTask, .name = "false_starts"}, as_count_of_n),
       column("Fell", {.task = kEveryTask, .name = "fell"}, as_count),
       column("Not judged", {.task = kEveryTask, .name = "not_judged"}, as_count)});
  pivot.notes = {fmt::format(
      "Success under the rule interaction with {:g} % Wilson intervals, by clip where a clip has several episodes, and "
      "under the detectors robot/paper that ask for less. False starts: the robot begins more than {:g} s before its "
      "partner, withdrawn beginnings included, of "
      "the episodes in which both begin; nobody waits in a hug.",
      100.0 * level, kFalseStart)};
  return table_of(estimates, pivot);
}

TitledTable condition_table(const Estimates& estimates) {
  Pivot pivot{.title = "What failed episodes lack",
              .rows = policy_rows({kTaskLabel}),
              .columns = {column("n", {.name = "success"}, as_n), column("Succeeded", {.name = "success"}, as_k)},
              .notes = {"Episodes that do not meet a condition of the rule; one may lack several. \"-\": asked of none "
                        "(body: where the partner is a ghost)."}};
  for (const char* part : kInteractionParts)
    pivot.columns.push_back(column(part, {.of = part, .name = "failed"}, as_count));
  pivot.columns.push_back(column("False starts", {.name = "false_starts"}, as_count_of_n));
  pivot.columns.push_back(column("Not judged", {.name = "not_judged"}, as_count));
  TitledTable titled = table_of(estimates, pivot);
  titled.too_long_for_terminal = true;
  return titled;
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

Analysis interaction_analysis(const std::vector<EpisodeRow>& rows, double level) {
  std::map<PolicyKey, EpisodeRows> arms;
  bool judged = false;
  for (const EpisodeRow* row : distinct_episodes(rows)) {
    if (row->perturbation != kClean || row->outcome == Outcome::kUnsupported) continue;
    judged = judged || rule_verdict(*row) != nullptr;
    const auto [found, is_new] = arms[policy_key(*row)].try_emplace(episode_id(*row), row);
    if (!is_new) require_distinct(*found->second, *row);
  }
  Analysis analysis{.name = "interaction", .title = "The rule interaction", .level = level};
  if (!judged) {
    analysis.notes = {"No episode was judged by the rule interaction."};
    return analysis;
  }
  std::vector<Estimates> found;  // arms by success, best first
  found.reserve(arms.size());
  for (const auto& [key, episodes] : arms) found.push_back(arm_estimates(key, episodes, level));
  std::ranges::stable_sort(found, std::greater(), [](const Estimates& of) { return of.front().value; });
  for (Estimates& of : found) std::ranges::move(of, std::back_inserter(analysis.estimates));
  analysis.tables = {success_table(analysis.estimates, level), condition_table(analysis.estimates)};
  return analysis;
}

namespace {

constexpr std::array<std::string_view, 2> kPeople = {kRecordedPeople, kSyntheticPeople};

using BothPeople = std::array<EpisodeRows, kPeople.size()>;
using PeopleByTask = std::map<std::pair<int, std::string>, BothPeople>;  // by rank and name

// The two roles of a recording and its draws resemble each other: every interval is by clip.
Rate rate_by_clip(const EpisodeRows& rows, bool (*counts)(const EpisodeRow&), double level) {
  SuccessByClip found;
  for (const auto& [id, row] : rows) found.add(id, counts(*row) ? 1.0 : 0.0);
  return make_rate(found, level);
}

void add_people(const PolicyKey& key, const std::string& task, const BothPeople& rows, double level, Estimates& into) {
  EstimatesOf of = estimates_of(key, into);
  of.keys.task = task;
  const Rate recorded = rate_by_clip(rows[0], headline_success, level);
  const Rate synthetic = rate_by_clip(rows[1], headline_success, level);
  of.add("recorded_minus_synthetic", recorded.n + synthetic.n, recorded.rate - synthetic.rate,
         newcombe_of_shares(recorded.rate, recorded.interval, synthetic.rate, synthetic.interval));
  for (std::size_t i = 0; i < kPeople.size(); ++i) {
    of.keys.of = kPeople[i];
    of.rate("success", i == 0 ? recorded : synthetic);
    of.rate("falls", rate_by_clip(
                         rows[i], [](const EpisodeRow& row) { return row.fell; }, level));
  }
}

// "12 of 40 recorded clips have legs that were made up": of each kind that there is. A clip in its other role is
// another.
std::vector<std::string> made_up_notes(const std::vector<EpisodeRow>& rows) {
  std::set<std::string_view> recorded;
  std::map<std::string_view, std::set<std::string_view>> clips;
  for (const EpisodeRow& row : rows) {
    if (row.tags.text(kPeopleTag) != kRecordedPeople) continue;
    recorded.insert(row.clip);
    if (const std::string_view kinds = row.tags.text(kMadeUpTag); !kinds.empty())
      for (const std::string_view kind : split(kinds, '+')) clips[kind].insert(row.clip);
  }
  std::vector<std::string> notes;
  for (const auto& [kind, of] : clips)
    notes.push_back(fmt::format("Made up in {} of {} recorded clips: {}.", of.size(), recorded.size(), kind));
  return notes;
}

Pivot people_pivot(const std::vector<EpisodeRow>& rows, double level) {
  Pivot pivot{.title = "Recorded and synthetic people", .rows = policy_rows({kTaskLabel}), .columns = {}};
  for (const auto& [people, title] : {std::pair("recorded", "Recorded [%]"), std::pair("synthetic", "Synthetic [%]")}) {
    const Estimate success{.of = people, .name = "success"};
    pivot.columns.insert(pivot.columns.end(), {column("n", success, as_n), column(title, success, as_percent),
                                               column("Fell [%]", {.of = people, .name = "falls"}, as_share)});
  }
  pivot.columns.push_back(column("Recorded - synthetic [points]", {.name = "recorded_minus_synthetic"}, as_points));
  pivot.notes = {
      fmt::format("Success under the headline detector with {0:g} % Wilson intervals by clip, a recording in either "
                  "role being one; the difference with Newcombe's {0:g} % interval for independent shares, of the "
                  "same intervals. The leaderboard counts both kinds together.",
                  100.0 * level)};
  for (std::string& note : made_up_notes(rows)) pivot.notes.push_back(std::move(note));
  return pivot;
}

}  // namespace

Analysis people_analysis(const std::vector<EpisodeRow>& rows, double level) {
  std::map<PolicyKey, PeopleByTask> policies;
  for (const EpisodeRow* row : distinct_episodes(rows)) {
    const auto people = std::ranges::find(kPeople, row->tags.text(kPeopleTag));
    if (row->perturbation != kClean || row->outcome == Outcome::kUnsupported || people == kPeople.end()) continue;
    policies[policy_key(*row)][{task_rank(row->task), row->task}][static_cast<std::size_t>(people - kPeople.begin())]
        .emplace(episode_id(*row), row);
  }
  Analysis analysis{.name = "people", .title = "Recorded and synthetic people", .level = level};
  for (const auto& [key, tasks] : policies) {
    BothPeople all;
    for (const auto& [task, both] : tasks) {
      if (both[0].empty() || both[1].empty()) continue;
      add_people(key, task.second, both, level, analysis.estimates);
      for (std::size_t i = 0; i < all.size(); ++i) all[i].insert(both[i].begin(), both[i].end());
    }
    if (!all[0].empty()) add_people(key, "all", all, level, analysis.estimates);
  }
  if (analysis.empty())
    analysis.notes = {"No run with recorded and synthetic people."};
  else
    analysis.tables = {table_of(analysis.estimates, people_pivot(rows, level))};
  return analysis;
}

}  // namespace duet
