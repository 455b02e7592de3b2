#include <fmt/format.h>

#include <cmath>
#include <map>
#include <tuple>

#include "duet/report/studies/studies.h"
#include "duet/rows/groups/distinct_episodes.h"
#include "duet/rows/groups/row_groups.h"

namespace duet {
namespace {

// A metric of rows and how the table calls it.
struct WalkColumn {
  const char *metric, *title, *unit;
  int decimals;
};
constexpr WalkColumn kWalkColumns[] = {
    {"speed_forward", "Forward", "m/s", 3},   {"speed_sideways", "To the left", "m/s", 3},
    {"turn_rate", "Turning", "rad/s", 3},     {"drift", "Distance", "m", 2},
    {"swing_height", "Swing height", "m", 3}, {"closest_feet", "Closest feet", "m", 3},
    {"root_error", "Root error", "m", 3},     {"upper_body_error", "Upper body", "rad", 3},
    {"time_to_fall", "Time to fall", "s", 1}};

using WalkRows = std::vector<const EpisodeRow*>;

void add_mean(const WalkColumn& column, const WalkRows& rows, const EstimatesOf& into) {
  double sum = 0.0;
  long n = 0;
  for (const EpisodeRow* row : rows) {
    const auto found = row->metrics.find(column.metric);
    if (row->outcome == Outcome::kUnsupported || found == row->metrics.end() || !std::isfinite(found->second)) continue;
    sum += found->second;
    ++n;
  }
  if (n > 0) into.add(column.metric, {}, sum / static_cast<double>(n), kNoInterval, column.unit);
}

void add_walk(const WalkRows& rows, double level, Estimates& into) {
  const EpisodeRow& first = *rows.front();
  const EstimatesOf of{{.engine = first.engine,
                        .controller = first.controller,
                        .perturbation = first.perturbation,
                        .task = std::string(kWalkRows),
                        .of = first.clip},
                       into};
  Rate upright;
  for (const EpisodeRow* row : rows) {
    upright.n += row->outcome != Outcome::kUnsupported ? 1 : 0;
    upright.k += row->outcome == Outcome::kOk ? 1 : 0;
  }
  upright.interval = wilson(upright.k, upright.n, level);
  if (upright.n > 0) upright.rate = static_cast<double>(upright.k) / static_cast<double>(upright.n);
  of.rate("upright", upright);
  of.count("unsupported", {}, static_cast<long>(rows.size()) - upright.n);
  for (const WalkColumn& column : kWalkColumns) add_mean(column, rows, of);
}

TitledTable walk_rows(const Estimates& estimates, double level) {
  const Estimate upright{.name = "upright"};
  Pivot pivot{
      .title = "Walking by command",
      .rows = {{"Perturbation", &Estimate::perturbation, true},
               {"Controller", &Estimate::controller, true},
               {"Command", &Estimate::of, true},
               {"Engine", &Estimate::engine, true}},
      .columns = {
          column("Upright", upright,
                 [](const Estimate& of) { return of.n == 0 ? "not run" : fmt::format("{} of {}", *of.k, *of.n); }),
          column("Interval [%]", upright, [](const Estimate& of) {
            return of.n == 0 ? "-" : fmt::format("{} to {}", percent(of.interval.low), percent(of.interval.high));
          })}};
  for (const WalkColumn& of : kWalkColumns)
    pivot.columns.push_back(
        column(fmt::format("{} [{}]", of.title, of.unit), {.name = of.metric},
               [&of](const Estimate& mean) { return fmt::format("{:.{}f}", mean.value, of.decimals); }));
  TitledTable titled = table_of(estimates, pivot);
  titled.caption = fmt::format(
      "Means over episodes; speeds from 2 s on, in the robot's heading. Upright: neither fell nor failed, Wilson "
      "interval ({:.0f} %).",
      100.0 * level);
  return titled;
}

double command_of(const EpisodeRow& row, const char* name) {
  const auto found = row.metrics.find(name);
  return found == row.metrics.end() ? 0.0 : found->second;
}

// Clean first; slow before fast, whatever the commands are called.
auto walk_place(const EpisodeRow& row) {
  return std::tuple(row.perturbation != "clean", row.perturbation, row.controller, command_of(row, "command_forward"),
                    command_of(row, "command_sideways"), command_of(row, "command_turn"), row.clip, row.engine);
}

}  // namespace

Analysis walk_analysis(const std::vector<EpisodeRow>& rows, double level) {
  std::map<decltype(walk_place(EpisodeRow())), WalkRows> groups;
  for (const EpisodeRow* row : distinct_episodes(rows))
    if (row->task == kWalkRows) groups[walk_place(*row)].push_back(row);
  Analysis analysis{.name = "walking", .title = "Walking by command", .level = level, .opens = true};
  for (const auto& [place, members] : groups) add_walk(members, level, analysis.estimates);
  if (analysis.empty())
    analysis.notes = {"No episode of these results is led by a commanded velocity."};
  else
    analysis.tables = {walk_rows(analysis.estimates, level)};
  return analysis;
}

}  // namespace duet
