#include "duet/rows/groups/row_groups.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <map>
#include <string_view>
#include <tuple>
#include <utility>

#include "duet/core/require.h"
#include "duet/core/task.h"
#include "duet/rows/folder/run_info.h"
#include "duet/rows/row_file.h"

namespace duet {
namespace {

// Episodes of one walking command have nothing in common but the command: each stands alone.
int clip_number(const EpisodeId& id, ClipNumbers& numbers) {
  return id.task == kWalkRows ? numbers.of(id.task, fmt::format("{} {}", id.clip, id.episode)) : numbers.of(id);
}

}  // namespace

EpisodeId episode_id(const EpisodeRow& row) {
  return {.task = row.task, .clip = row.clip, .episode = row.episode, .recording = row.tags.text(kRecordingTag)};
}

bool verdict_success(const EpisodeRow& row, const Verdict& verdict) {
  return row.outcome == Outcome::kOk && verdict.success;
}

bool headline_success(const EpisodeRow& row) { return row.outcome == Outcome::kOk && row.success.value_or(false); }

void SuccessByClip::add(const EpisodeId& id, double success) {
  values_.push_back(success);
  clips_.push_back(clip_number(id, numbers_));
}

Interval SuccessByClip::of_episodes(double level) const {
  return several_a_clip() ? by_clip(level) : wilson(successes(), episodes(), level);
}

void EpisodePairs::add(const EpisodeRow& a, const EpisodeRow& b) {
  table_.add(headline_success(a), headline_success(b));
  a_.push_back(headline_success(a) ? 1.0 : 0.0);
  b_.push_back(headline_success(b) ? 1.0 : 0.0);
  clips_.push_back(clip_number(episode_id(a), numbers_));
}

Interval EpisodePairs::bootstrap(const IntervalOptions& options) const {
  std::vector<double> differences(a_.size());
  std::ranges::transform(a_, b_, differences.begin(), std::minus<>());
  const Interval drawn = cluster_bootstrap(differences, clips_, options.resamples, options.seed, options.level);
  const Interval least = by_clip(options.level);
  return {.low = std::min(drawn.low, least.low), .high = std::max(drawn.high, least.high)};
}

Interval EpisodePairs::of_episodes(double level) const {
  if (several_a_clip()) return by_clip(level);
  return newcombe_paired(table_.both, table_.only_a, table_.only_b, table_.neither, level);
}

double EpisodePairs::p() const {
  std::vector<long> sums(numbers_.size(), 0);
  for (std::size_t i = 0; i < a_.size(); ++i) sums[static_cast<std::size_t>(clips_[i])] += std::lround(a_[i] - b_[i]);
  return sign_flip_exact(sums);
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
  IdentityCheck digests;
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

namespace {

using Arms = std::tuple<std::string_view, std::string_view, std::string_view, std::string_view, std::string_view>;

Arms arms_of(const EpisodeRow& row) { return {row.engine, row.controller, row.policy, row.perturbation, row.arm}; }

bool repeats(const EpisodeRow& first, const EpisodeRow& other) {
  const std::vector<std::string> fields = differing_fields(first, other);
  return std::ranges::all_of(
      fields, [](const std::string& field) { return field == "key" || field == "episode" || field == "seed"; });
}

struct Distinct {
  std::vector<const EpisodeRow*> rows;
  std::map<Arms, int> repeated;  // how many are left out
};

// Rows of one clip by arms and state hash: what repeats is among them.
using SameStates = std::map<std::pair<Arms, std::string_view>, std::vector<const EpisodeRow*>>;

Distinct fold(const std::vector<EpisodeRow>& rows) {
  Distinct distinct;
  distinct.rows.reserve(rows.size());
  SameStates seen;
  const EpisodeRow* before = nullptr;
  for (const EpisodeRow* row : in_episode_order(rows)) {
    if (before != nullptr && (row->task != before->task || row->clip != before->clip)) seen.clear();
    before = row;
    std::vector<const EpisodeRow*>& same = seen[{arms_of(*row), row->state_hash}];
    const auto is_repeat = [&](const EpisodeRow* first) {
      return first->episode != row->episode && repeats(*first, *row);
    };
    if (!row->state_hash.empty() && std::ranges::any_of(same, is_repeat)) {
      ++distinct.repeated[arms_of(*row)];
      continue;
    }
    same.push_back(row);
    distinct.rows.push_back(row);
  }
  return distinct;
}

}  // namespace

std::vector<const EpisodeRow*> distinct_episodes(const std::vector<EpisodeRow>& rows) {
  require_one_suite(rows);
  return fold(rows).rows;
}

std::string repeats_note(const std::vector<EpisodeRow>& rows) {
  const Distinct distinct = fold(rows);
  if (distinct.repeated.empty()) return "";
  std::vector<std::string> groups;
  for (const auto& [combination, count] : distinct.repeated) {
    const auto& [engine, controller, policy, perturbation, arm] = combination;
    groups.push_back(fmt::format("{}/{}/{} {}: {}", engine, controller, policy, perturbation, count));
  }
  return fmt::format("{} of {} episodes repeat another one of their clip bit for bit and count once ({})",
                     rows.size() - distinct.rows.size(), rows.size(), fmt::join(groups, ", "));
}

}  // namespace duet
