#include "duet/results/statistics/row_groups.h"

#include <fmt/format.h>

#include <algorithm>
#include <tuple>

#include "duet/core/require.h"
#include "duet/core/task.h"
#include "duet/results/rows/name_digests.h"

namespace duet {

EpisodeId episode_id(const EpisodeRow& row) { return {.task = row.task, .clip = row.clip, .episode = row.episode}; }

bool headline_success(const EpisodeRow& row) {
  return (row.outcome == Outcome::kOk || row.outcome == Outcome::kFell) && row.success.value_or(false);
}

std::vector<const EpisodeRow*> in_episode_order(const std::vector<EpisodeRow>& rows) {
  std::vector<const EpisodeRow*> sorted;
  sorted.reserve(rows.size());
  for (const EpisodeRow& row : rows) sorted.push_back(&row);
  std::stable_sort(sorted.begin(), sorted.end(), [](const EpisodeRow* a, const EpisodeRow* b) {
    return std::tie(a->task, a->clip, a->episode) < std::tie(b->task, b->clip, b->episode);
  });
  return sorted;
}

void require_one_suite(const std::vector<EpisodeRow>& rows) {
  for (const EpisodeRow& row : rows) {
    const EpisodeRow& first = rows.front();
    if (row.suite != first.suite || row.suite_version != first.suite_version)
      throw InputError(fmt::format("rows of suites {}@{} and {}@{}: results are comparable only within one version",
                                   first.suite, first.suite_version, row.suite, row.suite_version));
    if (row.detectors != first.detectors)
      throw InputError(fmt::format("rows judged by detectors {} and {}: results are comparable only within one version",
                                   first.detectors, row.detectors));
  }
  NameDigests digests;
  for (const EpisodeRow& row : rows)
    digests.add(row, fmt::format("the row of {} {} {}", row.task, row.clip, row.episode));
}

void require_distinct(const EpisodeRow& a, const EpisodeRow& b) {
  if (episode_id(a) != episode_id(b)) return;
  throw InputError(fmt::format("the episode {} {} {} of {}/{}/{} {} ({} arm) is there twice", a.task, a.clip, a.episode,
                               a.engine, a.controller, a.policy, a.perturbation, a.arm));
}

int task_rank(std::string_view task) {
  for (const Task known : all_tasks())
    if (to_string(known) == task) return known.index();
  return static_cast<int>(all_tasks().size()) + (task == "all" ? 1 : 0);
}

}  // namespace duet
