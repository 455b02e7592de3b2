#include "duet/datasets/interaction_tables.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>
#include <set>

#include "duet/core/numbers.h"
#include "duet/metrics/motion_windows.h"
#include "duet/statistics/told_apart.h"

namespace duet {
namespace {

std::string spread_cell(const StatisticSpread& spread, const InteractionStatisticInfo& info) {
  if (spread.clips == 0) return "-";
  if (info.is_share) return fmt::format("{:.2f}", spread.middle);
  const int digits = info.unit == "m" && spread.high < 0.1 ? 3 : 2;
  return fmt::format("{:.{}f} {:.{}f} {:.{}f}", spread.low, digits, spread.middle, digits, spread.high, digits);
}

std::string ratio_cell(const StatisticSpread& one, const StatisticSpread& other, const InteractionStatisticInfo& info) {
  return info.is_share ? fmt::format("{:+.2f}", one.middle - other.middle)
                       : fmt::format("{:.2f}", one.middle / other.middle);
}

std::string clips_cell(const InteractionSet& set, Task task) { return std::to_string(set.of(task).size()); }

}  // namespace

std::vector<InteractionStatistics> InteractionSet::of(Task task) const {
  std::vector<InteractionStatistics> chosen;
  for (std::size_t i = 0; i < clips.size(); ++i)
    if (tasks[i] == task) chosen.push_back(clips[i]);
  return chosen;
}

TextTable interaction_table(std::span<const InteractionSet> sets, Task task) {
  TextTable table{.header = {std::string(to_string(task)), "unit"}, .rows = {{"Clips", ""}}, .label_columns = 2};
  for (const InteractionStatisticInfo& info : interaction_statistic_catalogue())
    table.rows.push_back({std::string(info.title), std::string(info.unit)});
  for (const InteractionSet& set : sets) {
    const std::vector<InteractionStatistics> clips = set.of(task);
    table.header.push_back(set.name);
    table.rows[0].push_back(clips_cell(set, task));
    std::size_t row = 0;
    for (const InteractionStatisticInfo& info : interaction_statistic_catalogue())
      table.rows[++row].push_back(spread_cell(spread_of(clips, info), info));
  }
  return table;
}

TextTable interaction_table(const InteractionSet& set, const InteractionSet& against, Task task) {
  const std::vector<InteractionStatistics> ours = set.of(task), theirs = against.of(task);
  TextTable table{.header = {std::string(to_string(task)), "unit", set.name, against.name, "ratio", "apart"},
                  .rows = {},
                  .label_columns = 2};
  table.rows.push_back({"Clips", "", clips_cell(set, task), clips_cell(against, task), "", ""});
  for (const InteractionStatisticInfo& info : interaction_statistic_catalogue()) {
    const StatisticSpread one = spread_of(ours, info), other = spread_of(theirs, info);
    const bool both = one.clips > 0 && other.clips > 0;
    table.rows.push_back({std::string(info.title), std::string(info.unit), spread_cell(one, info),
                          spread_cell(other, info), both ? ratio_cell(one, other, info) : "-",
                          !both || agree(one, other, info) ? "" : "*"});
  }
  return table;
}

InteractionAgreement interaction_agreement(const InteractionSet& set, const InteractionSet& against, Task task) {
  const std::vector<InteractionStatistics> ours = set.of(task), theirs = against.of(task);
  InteractionAgreement found;
  for (const InteractionStatisticInfo& info : interaction_statistic_catalogue()) {
    const StatisticSpread one = spread_of(ours, info), other = spread_of(theirs, info);
    if (one.clips == 0 || other.clips == 0) continue;
    ++found.compared;
    found.agreeing += agree(one, other, info);
  }
  return found;
}

namespace {

constexpr std::uint64_t kTellingSeed = 1;  // of folds, halves and resamples

// The statistics that a classifier is shown.
std::vector<const InteractionStatisticInfo*> shown_statistics() {
  std::vector<const InteractionStatisticInfo*> shown;
  for (const InteractionStatisticInfo& info : interaction_statistic_catalogue())
    if (info.name != "source_rate_hz") shown.push_back(&info);
  return shown;
}

enum class Seen { kStatistics, kWindows };
constexpr std::array<Seen, 2> kBothWays = {Seen::kStatistics, Seen::kWindows};

// Adds the samples of a set's clips to those of one group; clusters go on from `cluster`.
void add_samples(const InteractionSet& set, Task task, Seen seen, bool first, int& cluster,
                 std::vector<GroupedSample>& samples) {
  for (std::size_t i = 0; i < set.clips.size(); ++i) {
    if (set.tasks[i] != task) continue;
    ++cluster;
    if (seen == Seen::kStatistics) {
      GroupedSample sample{.features = {}, .first = first, .cluster = cluster};
      for (const InteractionStatisticInfo* info : shown_statistics())
        sample.features.push_back(set.clips[i].*info->value);
      samples.push_back(std::move(sample));
    } else if (i < set.windows.size()) {
      for (const std::vector<double>& window : set.windows[i])
        samples.push_back({.features = window, .first = first, .cluster = cluster});
    }
  }
}

bool enough(const std::vector<GroupedSample>& samples) {
  std::array<std::set<int>, 2> clusters;
  for (const GroupedSample& sample : samples) clusters[sample.first ? 1 : 0].insert(sample.cluster);
  return std::ranges::all_of(clusters, [](const auto& ids) { return std::ssize(ids) >= kFewestToTell; });
}

// The samples of sets, of which that with number `one` is the first group.
std::vector<GroupedSample> against_others(std::span<const InteractionSet> sets, std::size_t one, Task task, Seen seen) {
  std::vector<GroupedSample> samples;
  int cluster = 0;
  for (std::size_t i = 0; i < sets.size(); ++i) add_samples(sets[i], task, seen, i == one, cluster, samples);
  return samples;
}

// All sets in one, every clip in a half that is drawn.
std::vector<GroupedSample> in_halves(std::span<const InteractionSet> sets, Task task, Seen seen, int draw) {
  std::vector<GroupedSample> samples = against_others(sets, sets.size(), task, seen);
  for (GroupedSample& sample : samples)
    sample.first =
        Random(kTellingSeed, stream_key({"half", std::to_string(draw), std::to_string(sample.cluster)})).chance(0.5);
  return samples;
}

constexpr int kHalvings = 8;

std::string told_cell(double area, const Interval& interval) {
  return fmt::format("{:.2f} [{:.2f}, {:.2f}]", area, interval.low, interval.high);
}

std::vector<std::string> told_row(const std::string& name, std::span<const InteractionSet> sets, std::size_t one,
                                  Task task) {
  std::vector<std::string> row = {name};
  for (const Seen seen : kBothWays) {
    const std::vector<GroupedSample> samples = against_others(sets, one, task, seen);
    if (!enough(samples)) {
      row.emplace_back("-");
      continue;
    }
    const ToldApart told = told_apart(samples, kTellingSeed);
    row.push_back(told_cell(told.area, told.interval));
  }
  return row;
}

// The mean over kHalvings draws of the halves, and the least and the largest of them.
std::vector<std::string> halves_row(std::span<const InteractionSet> sets, Task task) {
  std::vector<std::string> row = {"halves of the others"};
  for (const Seen seen : kBothWays) {
    std::vector<double> areas;
    for (int draw = 0; draw < kHalvings; ++draw) {
      const std::vector<GroupedSample> samples = in_halves(sets, task, seen, draw);
      if (enough(samples)) areas.push_back(told_apart(samples, kTellingSeed).area);
    }
    row.push_back(areas.empty() ? "-"
                                : told_cell(std::accumulate(areas.begin(), areas.end(), 0.0) / areas.size(),
                                            {std::ranges::min(areas), std::ranges::max(areas)}));
  }
  return row;
}

std::string words_of(const ToldApart& told, Seen seen) {
  constexpr std::size_t kShown = 6;
  std::vector<std::string> names;
  for (std::size_t i = 0; i < std::min(kShown, told.weights.size()); ++i) {
    const FeatureWeight& weight = told.weights[i];
    const std::string name = seen == Seen::kStatistics ? std::string(shown_statistics()[weight.feature]->title)
                                                       : window_feature_names()[weight.feature];
    names.push_back(fmt::format("{} ({})", name,
                                std::abs(weight.square) > std::abs(weight.linear)
                                    ? weight.square > 0 ? "wider" : "narrower"
                                : weight.linear > 0 ? "more"
                                                    : "less"));
  }
  return fmt::format("{}", fmt::join(names, ", "));
}

}  // namespace

TextTable told_apart_table(std::span<const InteractionSet> sets, Task task) {
  const std::span<const InteractionSet> others = sets.subspan(1);
  TextTable table{.header = {fmt::format("{}: told apart", to_string(task)), "by statistics", "by windows"},
                  .rows = {},
                  .label_columns = 1};
  table.rows.push_back(told_row(fmt::format("{} / the others", sets[0].name), sets, 0, task));
  for (std::size_t i = 0; others.size() > 1 && i < others.size(); ++i)
    table.rows.push_back(told_row(fmt::format("{} / the rest of them", others[i].name), others, i, task));
  table.rows.push_back(halves_row(others, task));
  return table;
}

std::string told_by(std::span<const InteractionSet> sets, Task task) {
  std::string text;
  for (const Seen seen : kBothWays) {
    const std::vector<GroupedSample> samples = against_others(sets, 0, task, seen);
    if (!enough(samples)) continue;
    text += fmt::format("{}: {} is known by its {}: {}.\n", to_string(task), sets[0].name,
                        seen == Seen::kStatistics ? "statistics" : "windows",
                        words_of(told_apart(samples, kTellingSeed), seen));
  }
  return text;
}

}  // namespace duet
