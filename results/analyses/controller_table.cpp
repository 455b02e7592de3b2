#include "duet/results/analyses/controller_table.h"

#include <algorithm>
#include <map>
#include <tuple>

#include "duet/results/analyses/cross_engine.h"
#include "duet/results/rows/distinct_episodes.h"
#include "duet/results/statistics/row_groups.h"

namespace duet {
namespace {

struct GroupKey {
  bool perturbed = false;  // clean first
  std::string perturbation, policy, controller, engine;
  auto operator<=>(const GroupKey&) const = default;
};

using RowList = std::vector<const EpisodeRow*>;

// Source: supplement A.4.6, Table S4.
constexpr std::array<double, 3> kBeforeDstar = {0.162, 286.2, 115.6};
constexpr std::array<double, 3> kBeforeDiffusion = {0.165, 180.0, 119.3};
constexpr std::array<PaperController, 6> kPaper = {
    {{"D-STAR", "WBC-Sim", {0.614, 2259.5, 227.6, 0.031, 13.8, 0.304, 1.558}, kBeforeDstar},
     {"D-STAR", "HOMIE", {0.297, 827.4, 171.2, 0.349, 52.6, 0.370, 0.644}, kBeforeDstar},
     {"D-STAR", "TWIST2", {0.203, 499.3, 120.0, 0.367, 48.7, 0.249, 0.436}, kBeforeDstar},
     {"DP", "WBC-Sim", {0.591, 2146.1, 201.0, 0.034, 9.9, 0.242, 1.479}, kBeforeDiffusion},
     {"DP", "HOMIE", {0.285, 833.5, 175.8, 0.391, 50.0, 0.348, 0.634}, kBeforeDiffusion},
     {"DP", "TWIST2", {0.195, 498.0, 126.2, 0.358, 47.5, 0.226, 0.446}, kBeforeDiffusion}}};

// Numbers for the clips of rows in episode order, the clusters of the bootstrap.
int clip_number(const EpisodeRow& row, std::map<std::pair<std::string, std::string>, int>& numbers) {
  return numbers.try_emplace({row.task, row.clip}, static_cast<int>(numbers.size())).first->second;
}

Estimate estimate(const RowList& rows, const std::string& metric, ClusterBootstrap& bootstrap, double level) {
  std::vector<double> values;
  std::vector<int> clips;
  std::map<std::pair<std::string, std::string>, int> numbers;
  for (const EpisodeRow* row : rows) {
    const auto found = row->metrics.find(metric);
    if (found == row->metrics.end()) continue;
    values.push_back(found->second);
    clips.push_back(clip_number(*row, numbers));
  }
  Estimate result;
  if (values.empty()) return result;
  double sum = 0.0;
  for (const double value : values) sum += value;
  result.n = static_cast<long>(values.size());
  result.mean = sum / static_cast<double>(result.n);
  if (numbers.size() >= 2) result.interval = bootstrap.mean(values, clips, level);
  return result;
}

void count(const EpisodeRow& row, ControllerEntry& entry) {
  if (row.outcome == Outcome::kUnsupported) {
    ++entry.unsupported;
    return;
  }
  ++entry.n;
  if (row.outcome == Outcome::kOk && !row.fell) ++entry.survived;
  if (row.faults.any()) ++entry.faulty;
  if (row.faults.stopped) ++entry.stopped;
}

ControllerEntry summarise(const GroupKey& key, const RowList& rows, ClusterBootstrap& bootstrap, double level) {
  ControllerEntry entry;
  std::tie(entry.perturbation, entry.policy, entry.controller, entry.engine) =
      std::tie(key.perturbation, key.policy, key.controller, key.engine);
  for (const EpisodeRow* row : rows) count(*row, entry);
  entry.survival = wilson(entry.survived, entry.n, level);
  for (const ControllerFigure& figure : kControllerFigures) {
    for (const std::string_view metric : {figure.metric, figure.before})
      if (!metric.empty()) entry.figures.emplace(metric, estimate(rows, std::string(metric), bootstrap, level));
  }
  return entry;
}

bool has_figures(const ControllerEntry& entry) {
  return std::any_of(entry.figures.begin(), entry.figures.end(),
                     [](const auto& figure) { return figure.second.n > 0; });
}

}  // namespace

std::span<const PaperController> paper_controllers() { return kPaper; }

ControllerTable controller_table(const std::vector<EpisodeRow>& rows, const ControllerTableOptions& options) {
  std::map<GroupKey, RowList> groups;
  for (const EpisodeRow* row : distinct_episodes(rows)) {
    if (row->arm != options.arm || row->engine == kPlaybackEngine) continue;
    RowList& group =
        groups[{row->perturbation != "clean", row->perturbation, row->policy, row->controller, row->engine}];
    if (!group.empty()) require_distinct(*group.back(), *row);
    group.push_back(row);
  }
  ControllerTable table{.level = options.level, .entries = {}};
  ClusterBootstrap bootstrap(options.resamples, options.seed);
  for (const auto& [key, members] : groups) table.entries.push_back(summarise(key, members, bootstrap, options.level));
  // Without one figure there is nothing to show; with some, those that could not run are shown too.
  if (std::none_of(table.entries.begin(), table.entries.end(), has_figures)) table.entries.clear();
  return table;
}

}  // namespace duet
