#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <tuple>

#include "duet/report/studies/studies.h"
#include "duet/rows/groups/row_groups.h"

namespace duet {
namespace {

// A metric of rows and how tables call it; `before`: of the reference, that is before the controller ("" where it is of
// both).
struct ControllerMetric {
  std::string_view metric, before, title, unit;
};
constexpr std::array<ControllerMetric, 7> kControllerMetrics = {
    {{"hf_ratio", "hf_ratio_reference", "HF ratio", "1"},
     {"dof_jerk", "dof_jerk_reference", "DOF jerk", "rad/s^3"},
     {"root_jerk", "root_jerk_reference", "Root jerk", "m/s^3"},
     {"root_error", "", "e_root", "m"},
     {"root_angle_error", "", "e_root", "deg"},
     {"dof_error", "", "e_dof", "rad"},
     {"dof_velocity_error", "", "e_dof", "rad/s"}}};

// A row of Table S4 as the supplement prints it; `values` as in kControllerMetrics, `before` its first three.
struct PaperController {
  std::string_view policy, controller;
  std::array<double, 7> values;
  std::array<double, 3> before;
};

// Source: supplement A.4.6, Table S4.
constexpr std::array<double, 3> kBeforeDstar = {0.162, 286.2, 115.6};
constexpr std::array<double, 3> kBeforeDiffusion = {0.165, 180.0, 119.3};
constexpr std::array<PaperController, 6> kPaperControllers = {
    {{"D-STAR", "WBC-Sim", {0.614, 2259.5, 227.6, 0.031, 13.8, 0.304, 1.558}, kBeforeDstar},
     {"D-STAR", "HOMIE", {0.297, 827.4, 171.2, 0.349, 52.6, 0.370, 0.644}, kBeforeDstar},
     {"D-STAR", "TWIST2", {0.203, 499.3, 120.0, 0.367, 48.7, 0.249, 0.436}, kBeforeDstar},
     {"DP", "WBC-Sim", {0.591, 2146.1, 201.0, 0.034, 9.9, 0.242, 1.479}, kBeforeDiffusion},
     {"DP", "HOMIE", {0.285, 833.5, 175.8, 0.391, 50.0, 0.348, 0.634}, kBeforeDiffusion},
     {"DP", "TWIST2", {0.195, 498.0, 126.2, 0.358, 47.5, 0.226, 0.446}, kBeforeDiffusion}}};

using ControlledRows = std::vector<const EpisodeRow*>;

// The mean over episodes that have the metric, with an interval unless they are of one clip, which drawn again is
// always itself.
void add_metric(const ControlledRows& rows, std::string_view metric, std::string_view unit, double level,
                ClusterBootstrap& bootstrap, const EstimatesOf& into) {
  std::vector<double> values;
  std::vector<int> clips;
  ClipNumbers numbers;
  for (const EpisodeRow* row : rows) {
    const auto found = row->metrics.find(std::string(metric));
    if (found == row->metrics.end()) continue;
    values.push_back(found->second);
    clips.push_back(numbers.of(episode_id(*row)));
  }
  into.add(metric, static_cast<long>(values.size()), mean_of(values),
           numbers.size() < 2 ? kNoInterval : bootstrap.mean(values, clips, level), unit);
}

void add_controller(const ControlledRows& rows, double level, ClusterBootstrap& bootstrap, Estimates& into) {
  const EpisodeRow& first = *rows.front();
  const EstimatesOf of{{.engine = first.engine,
                        .controller = first.controller,
                        .policy = first.policy,
                        .perturbation = first.perturbation},
                       into};
  for (const ControllerMetric& each : kControllerMetrics) {
    if (!each.before.empty()) add_metric(rows, each.before, each.unit, level, bootstrap, of);
    add_metric(rows, each.metric, each.unit, level, bootstrap, of);
  }
  const auto count = [&](const auto& is) { return static_cast<long>(std::ranges::count_if(rows, is)); };
  const auto ran = [](const EpisodeRow* row) { return row->outcome != Outcome::kUnsupported; };
  Rate survival{.n = count(ran),
                .k = count([](const EpisodeRow* row) { return row->outcome == Outcome::kOk && !row->fell; })};
  survival.interval = wilson(survival.k, survival.n, level);
  if (survival.n > 0) survival.rate = static_cast<double>(survival.k) / static_cast<double>(survival.n);
  of.rate("survival", survival);
  of.count("faulty", survival.n, count([&](const EpisodeRow* row) { return ran(row) && row->faults.any(); }));
  of.count("stopped", survival.n, count([&](const EpisodeRow* row) { return ran(row) && row->faults.stopped; }));
  of.count("unsupported", {}, static_cast<long>(rows.size()) - survival.n);
}

void add_paper_controllers(Estimates& into) {
  for (const PaperController& paper : kPaperControllers) {
    const EstimatesOf of{
        {.source = "paper", .controller = std::string(paper.controller), .policy = std::string(paper.policy)}, into};
    for (std::size_t i = 0; i < kControllerMetrics.size(); ++i) {
      const ControllerMetric& each = kControllerMetrics[i];
      if (!each.before.empty()) of.add(each.before, {}, paper.before[i], kNoInterval, each.unit);
      of.add(each.metric, {}, paper.values[i], kNoInterval, each.unit);
    }
  }
}

constexpr const char* kPapersSentence =
    "The rows marked \"the paper's\" are Table S4 as printed, and another experiment: its policies (D-STAR, "
    "Diffusion Policy) and Inter-X recordings are not the policies and clips of this suite, its WBC-Sim was never "
    "published, and it names neither its simulator nor the units and norms of jerk and errors. What can be held "
    "against it is the order of the controllers, not the values.";
constexpr const char* kTrackingSentence =
    "e_root and e_dof: distance of the executed root and joints from the reference. Survival: episodes that ended as "
    "planned and not by a fall, with Wilson intervals. Faults: episodes in which the controller met or made a number "
    "that is not finite, and those it ended with a safe stop.";

std::string engine_title(const Estimate& keys) { return keys.source == "paper" ? "the paper's" : keys.engine; }

Pivot controller_pivot(const char* title) {
  return {.title = title,
          .rows = {{"Perturbation", &Estimate::perturbation},
                   {"Policy", &Estimate::policy, true, [](const Estimate& keys) { return keys.policy; }},
                   {"Controller", &Estimate::controller, true},
                   {"Engine", &Estimate::engine, true, engine_title}},
          .columns = {column("n", {.name = "survival"}, as_n)}};
}

PivotColumn metric_column(std::string_view title, std::string_view metric, std::string_view unit) {
  return column(unit == "1" ? std::string(title) : fmt::format("{} [{}]", title, unit), {.name = std::string(metric)},
                as_short());
}

Pivot jitter_pivot(double level) {
  Pivot pivot = controller_pivot("Controllers: jitter before and after (Table S4)");
  for (const ControllerMetric& each : kControllerMetrics) {
    if (each.before.empty()) continue;
    pivot.columns.push_back(metric_column(fmt::format("{}, before", each.title), each.before, each.unit));
    pivot.columns.push_back(metric_column(each.title, each.metric, each.unit));
  }
  pivot.notes = {
      fmt::format(
          "Means over episodes with {:g} % intervals, clips drawn again. Before: of the reference that the "
          "controller is given. An episode that ends early counts with what it has. Lower is better throughout, "
          "but for survival. HF ratio: share of the joint-velocity energy above 5 Hz.",
          100.0 * level),
      kPapersSentence};
  return pivot;
}

std::string faults_cell(const PivotRow& row) {
  const Estimate *faulty = row.find({.name = "faulty"}), *stopped = row.find({.name = "stopped"});
  if (faulty == nullptr) return "-";
  return stopped->value == 0.0 ? as_count(*faulty) : fmt::format("{} ({} stopped)", faulty->value, stopped->value);
}

Pivot tracking_pivot(const Estimates& estimates) {
  Pivot pivot = controller_pivot("Controllers: tracking, survival and faults (Table S4)");
  for (const ControllerMetric& each : kControllerMetrics)
    if (each.before.empty()) pivot.columns.push_back(metric_column(each.title, each.metric, each.unit));
  pivot.columns.push_back(column("Survival [%]", {.name = "survival"}, as_percent));
  pivot.columns.push_back({"Faults", faults_cell});
  pivot.notes = {kTrackingSentence};
  double unsupported = 0.0;
  for (const Estimate& estimate : estimates)
    if (estimate.name == "unsupported") unsupported += estimate.value;
  if (unsupported > 0.0)
    pivot.notes.push_back(fmt::format(
        "{} episodes could not run on this machine and are in no figure; their rows say why.", unsupported));
  return pivot;
}

// Without one value of a metric there is nothing to show; with some, those that could not run are shown, too.
bool has_metric(const Estimates& estimates) {
  return std::ranges::any_of(kControllerMetrics, [&](const ControllerMetric& each) {
    return std::ranges::any_of(estimates, [&](const Estimate& estimate) {
      return (estimate.name == each.metric || estimate.name == each.before) && estimate.n > 0;
    });
  });
}

}  // namespace

Analysis controller_analysis(const std::vector<EpisodeRow>& rows, const IntervalOptions& options) {
  std::map<std::tuple<bool, std::string, std::string, std::string, std::string>, ControlledRows> groups;
  for (const EpisodeRow* row : distinct_episodes(rows)) {
    if (row->arm != "main" || row->engine == kPlaybackEngine) continue;
    ControlledRows& group =
        groups[{row->perturbation != "clean", row->perturbation, row->policy, row->controller, row->engine}];
    if (!group.empty()) require_distinct(*group.back(), *row);
    group.push_back(row);
  }
  Analysis analysis{.name = "controllers", .title = "Controllers", .level = options.level};
  Estimates& estimates = analysis.estimates;
  ClusterBootstrap bootstrap(options.resamples, options.seed);
  for (const auto& [place, members] : groups) add_controller(members, options.level, bootstrap, estimates);
  if (!has_metric(estimates)) {
    estimates.clear();
    analysis.notes = {"No episode ran under a controller in a physics engine."};
    return analysis;
  }
  add_paper_controllers(estimates);
  analysis.tables = {table_of(estimates, jitter_pivot(options.level)), table_of(estimates, tracking_pivot(estimates))};
  return analysis;
}

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
