#include "duet/report/studies/walk_table.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <tuple>

#include "duet/report/tables/cells.h"
#include "duet/rows/groups/distinct_episodes.h"

namespace duet {
namespace {

struct WalkKey {
  bool perturbed = false;  // clean first
  std::string perturbation, controller;
  std::tuple<double, double, double> velocity;  // slow before fast, whatever the commands are called
  std::string command, engine;
  auto operator<=>(const WalkKey&) const = default;
};

double metric_or_zero(const EpisodeRow& row, const char* name) {
  const auto found = row.metrics.find(name);
  return found == row.metrics.end() ? 0.0 : found->second;
}

WalkKey key_of(const EpisodeRow& row) {
  return {row.perturbation != "clean",
          row.perturbation,
          row.controller,
          {metric_or_zero(row, "command_forward"), metric_or_zero(row, "command_sideways"),
           metric_or_zero(row, "command_turn")},
          row.clip,
          row.engine};
}

WalkEntry summary_of(const WalkKey& key, const std::vector<const EpisodeRow*>& rows, double level) {
  WalkEntry entry{.perturbation = key.perturbation,
                  .controller = key.controller,
                  .command = key.command,
                  .engine = key.engine,
                  .interval = {},
                  .means = {}};
  std::map<std::string, std::pair<double, long>, std::less<>> sums;
  for (const EpisodeRow* row : rows) {
    if (row->outcome == Outcome::kUnsupported) {
      ++entry.unsupported;
      continue;
    }
    ++entry.n;
    if (row->outcome == Outcome::kOk) ++entry.upright;
    for (const WalkFigure& figure : walk_figures()) {
      const auto found = row->metrics.find(std::string(figure.metric));
      if (found == row->metrics.end() || !std::isfinite(found->second)) continue;
      sums[found->first].first += found->second;
      ++sums[found->first].second;
    }
  }
  for (const auto& [metric, sum] : sums) entry.means[metric] = sum.first / static_cast<double>(sum.second);
  entry.interval = wilson(entry.upright, entry.n, level);
  return entry;
}

std::string mean_cell(const WalkEntry& entry, const WalkFigure& figure) {
  const auto found = entry.means.find(figure.metric);
  return found == entry.means.end() ? "-" : fmt::format("{:.{}f}", found->second, figure.decimals);
}

std::string upright_cell(const WalkEntry& entry) {
  if (entry.n == 0) return "not run";
  return fmt::format("{} of {}", entry.upright, entry.n);
}

TitledTable walk_rows(const WalkTable& table) {
  TitledTable titled{.title = "Walking by command",
                     .caption = fmt::format("Means over episodes; speeds from 2 s on, in the robot's heading. Upright: "
                                            "neither fell nor failed, Wilson interval ({:.0f} %).",
                                            100.0 * table.level),
                     .table = {.header = {"Perturbation", "Controller", "Command", "Engine", "Upright", "Interval [%]"},
                               .rows = {},
                               .label_columns = 4}};
  for (const WalkFigure& figure : walk_figures())
    titled.table.header.push_back(fmt::format("{} [{}]", figure.title, figure.unit));
  for (const WalkEntry& entry : table.entries) {
    std::vector<std::string> cells = {
        entry.perturbation,
        entry.controller,
        entry.command,
        entry.engine,
        upright_cell(entry),
        entry.n == 0 ? "-" : fmt::format("{} to {}", percent(entry.interval.low), percent(entry.interval.high))};
    for (const WalkFigure& figure : walk_figures()) cells.push_back(mean_cell(entry, figure));
    titled.table.rows.push_back(std::move(cells));
  }
  return titled;
}

void add_walk_figures(const WalkEntry& entry, std::vector<Figure>& into) {
  const FiguresOf figures{{.engine = entry.engine,
                           .controller = entry.controller,
                           .perturbation = entry.perturbation,
                           .task = std::string(kWalkRows),
                           .of = entry.command},
                          into};
  Rate upright{.n = entry.n, .k = entry.upright, .interval = entry.interval};
  if (entry.n > 0) upright.rate = static_cast<double>(entry.upright) / static_cast<double>(entry.n);
  figures.rate("upright", upright);
  figures.count("unsupported", {}, entry.unsupported);
  for (const WalkFigure& figure : walk_figures())
    if (const auto found = entry.means.find(figure.metric); found != entry.means.end())
      figures.add(figure.metric, {}, found->second, kNoInterval, figure.unit);
}

}  // namespace

std::vector<WalkFigure> walk_figures() {
  return {{"speed_forward", "Forward", "m/s", 3},   {"speed_sideways", "To the left", "m/s", 3},
          {"turn_rate", "Turning", "rad/s", 3},     {"drift", "Distance", "m", 2},
          {"swing_height", "Swing height", "m", 3}, {"closest_feet", "Closest feet", "m", 3},
          {"root_error", "Root error", "m", 3},     {"upper_body_error", "Upper body", "rad", 3},
          {"time_to_fall", "Time to fall", "s", 1}};
}

WalkTable walk_table(const std::vector<EpisodeRow>& rows, double level) {
  std::map<WalkKey, std::vector<const EpisodeRow*>> groups;
  for (const EpisodeRow* row : distinct_episodes(rows))
    if (row->task == kWalkRows) groups[key_of(*row)].push_back(row);
  WalkTable table{.level = level, .entries = {}};
  for (const auto& [key, members] : groups) table.entries.push_back(summary_of(key, members, level));
  return table;
}

Analysis walk_analysis(const WalkTable& table) {
  Analysis analysis{.name = "walking", .title = "Walking by command", .level = table.level, .opens = true};
  if (table.entries.empty()) {
    analysis.notes = {"No episode of these results is led by a commanded velocity."};
    return analysis;
  }
  analysis.tables = {walk_rows(table)};
  for (const WalkEntry& entry : table.entries) add_walk_figures(entry, analysis.figures);
  return analysis;
}

}  // namespace duet
