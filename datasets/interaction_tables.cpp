#include "duet/datasets/interaction_tables.h"

#include <fmt/format.h>

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

TextTable interaction_table(const InteractionSet& set, Task task) {
  const std::vector<InteractionStatistics> clips = set.of(task);
  TextTable table{.header = {std::string(to_string(task)), "unit", set.name}, .rows = {}, .label_columns = 2};
  table.rows.push_back({"Clips", "", clips_cell(set, task)});
  for (const InteractionStatisticInfo& info : interaction_statistic_catalogue())
    table.rows.push_back({std::string(info.title), std::string(info.unit), spread_cell(spread_of(clips, info), info)});
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

}  // namespace duet
