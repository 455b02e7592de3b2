#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <optional>
#include <set>

#include "duet/core/numbers.h"
#include "duet/core/task.h"
#include "duet/report/ranking/policy_groups.h"
#include "duet/report/studies/studies.h"

namespace duet {
namespace {

constexpr const char* kAllTasks = "all";
constexpr double kPartnerShift = 0.1;  // from here on the partner's onset counts as moved [s]
constexpr double kNoReaction = std::numeric_limits<double>::quiet_NaN();

struct Onsets {
  double robot = kNoReaction, partner = kNoReaction;  // [s]; NaN: none

  [[nodiscard]] bool both() const { return std::isfinite(robot) && std::isfinite(partner); }
  [[nodiscard]] double delay() const { return robot - partner; }
};

Onsets onsets_of(const EpisodeRow& row) {
  const auto metric = [&](const char* name) {
    const auto found = row.metrics.find(name);
    return found == row.metrics.end() ? kNoReaction : found->second;
  };
  return {.robot = metric("onset_s"), .partner = metric("partner_onset_s")};
}

// Means over the episodes of one perturbation in which the partner's onset moved.
struct OnsetShift {
  std::string perturbation;
  long n = 0;
  double partner = 0.0, robot = 0.0;  // [s], later is positive
};

// The shifts of one policy, gathered before its figures are computed.
struct GatheredShifts {
  std::vector<double> products, squares;  // robot's times partner's shift, partner's squared
  std::vector<double> ratios, sizes;      // robot's over partner's shift, size of the partner's
  std::vector<int> clips;
  ClipNumbers numbers;
  std::vector<double> delays;
  long without = 0;

  void add(const EpisodeId& id, double robot, double partner) {
    products.push_back(robot * partner);
    squares.push_back(partner * partner);
    ratios.push_back(robot / partner);
    sizes.push_back(std::abs(partner));
    clips.push_back(numbers.of(id));
  }
};

OnsetShift gather(const std::string& perturbation, const EpisodeRows& perturbed, const EpisodeRows& clean,
                  GatheredShifts& gathered) {
  OnsetShift shift{.perturbation = perturbation};
  for (const auto& [id, row] : perturbed) {
    const auto found = clean.find(id);
    if (found == clean.end()) continue;
    const Onsets now = onsets_of(*row);
    const Onsets before = onsets_of(*found->second);
    const double partner = now.partner - before.partner;
    if (!(std::abs(partner) >= kPartnerShift)) continue;
    if (!now.both() || !before.both()) {
      ++gathered.without;
      continue;
    }
    const double robot = now.robot - before.robot;
    gathered.add(id, robot, partner);
    gathered.delays.push_back(now.delay());
    ++shift.n;
    shift.partner += partner;
    shift.robot += robot;
  }
  if (shift.n == 0) return shift;
  shift.partner /= static_cast<double>(shift.n);
  shift.robot /= static_cast<double>(shift.n);
  return shift;
}

double sum(const std::vector<double>& values) {
  double total = 0.0;
  for (const double value : values) total += value;
  return total;
}

std::vector<double> delays_of(const EpisodeRows& rows) {
  std::vector<double> delays;
  for (const auto& [id, row] : rows)
    if (const Onsets onsets = onsets_of(*row); onsets.both()) delays.push_back(onsets.delay());
  return delays;
}

// By the partner's shift.
std::vector<OnsetShift> gather_all(const PerturbedRows& rows, GatheredShifts& gathered) {
  std::vector<OnsetShift> shifts;
  for (const auto& [perturbation, episodes] : rows) {
    if (perturbation == kClean) continue;
    OnsetShift shift = gather(perturbation, episodes, rows.find(kClean)->second, gathered);
    if (shift.n > 0) shifts.push_back(std::move(shift));
  }
  std::ranges::stable_sort(shifts, {}, &OnsetShift::partner);
  return shifts;
}

void add_false_starts(const PerturbedRows& rows, const EstimatesOf& of) {
  long led = 0, false_starts = 0;
  for (const auto& [perturbation, episodes] : rows)
    for (const auto& [id, row] : episodes)
      if (const std::optional<double> lead = lead_of(*row)) {
        ++led;
        false_starts += *lead > kFalseStart ? 1 : 0;
      }
  of.count("false_starts", led, false_starts);
}

// Slopes of the robot's over the partner's shift, through the origin: 1 follows, 0 plays its clip. One by least
// squares, one by the least absolute deviations: what most episodes do. An arm that swings with the steps can pass for
// an onset, in a few episodes, and pulls the squares. Intervals are bootstraps over clips, of two or more.
void add_slopes(GatheredShifts& gathered, double level, ClusterBootstrap& bootstrap, const EstimatesOf& of) {
  const auto n = static_cast<long>(gathered.products.size());
  const bool several = gathered.numbers.size() > 1;
  of.add("slope", n, n > 0 ? sum(gathered.products) / sum(gathered.squares) : kNoReaction,
         several ? bootstrap.ratio(gathered.products, gathered.squares, gathered.clips, level) : kNoInterval);
  of.add("median_slope", n, weighted_median(gathered.ratios, gathered.sizes),
         several ? bootstrap.weighted_median(gathered.ratios, gathered.sizes, gathered.clips, level) : kNoInterval);
}

// Adds nothing where no partner moved. Delays are medians of the robot's minus its partner's onset.
void add_timing(const PerturbedRows& rows, double level, ClusterBootstrap& bootstrap, EstimatesOf of) {
  GatheredShifts gathered;
  const std::vector<OnsetShift> shifts = gather_all(rows, gathered);
  const auto n = static_cast<long>(gathered.products.size());
  if (n + gathered.without == 0) return;
  add_slopes(gathered, level, bootstrap, of);
  of.count("did_not_act", n + gathered.without, gathered.without);
  std::vector<double> delays = delays_of(rows.find(kClean)->second);
  const auto n_clean = static_cast<long>(delays.size());
  of.add("delay_clean", n_clean, quantile(std::move(delays), 0.5), kNoInterval, "s");
  of.add("delay_moved", n, quantile(std::move(gathered.delays), 0.5), kNoInterval, "s");
  add_false_starts(rows, of);
  for (const OnsetShift& shift : shifts) {
    of.keys.perturbation = shift.perturbation;
    of.add("partner_shift", shift.n, shift.partner, kNoInterval, "s");
    of.add("robot_shift", shift.n, shift.robot, kNoInterval, "s");
  }
}

// All rows and, where there are several tasks, each task's in its order.
std::vector<std::pair<std::string, PerturbedRows>> with_tasks(const PerturbedRows& rows) {
  std::map<std::pair<int, std::string>, PerturbedRows> tasks;
  for (const auto& [perturbation, episodes] : rows)
    for (const auto& [id, row] : episodes) tasks[{task_rank(id.task), id.task}][perturbation].emplace(id, row);
  std::vector<std::pair<std::string, PerturbedRows>> parts = {{kAllTasks, rows}};
  if (tasks.size() == 1) return parts;
  for (auto& [task, of] : tasks)
    if (of.contains(kClean)) parts.emplace_back(task.second, std::move(of));
  return parts;
}

// The two heights at which clips offer hands. [m]
struct OfferedHeights {
  double low = 0.0, high = 0.0;
};

// None unless the variants of clips have two heights.
std::optional<OfferedHeights> offered_heights(const std::vector<EpisodeRow>& rows) {
  std::set<double> heights;
  for (const EpisodeRow& row : rows)
    if (const double height = row.tags.number(kHeightTag); std::isfinite(height)) heights.insert(height);
  if (heights.size() != 2) return std::nullopt;
  return OfferedHeights{.low = *heights.begin(), .high = *heights.rbegin()};
}

struct SpatialCell {
  const char *variant, *title;
  double paper;  // Table S10, handshake
};
// In the order (high, low) by (left, right).
constexpr std::array<SpatialCell, 4> kSpatialCells = {{{"left_high", "Left, high", 0.8},
                                                       {"right_high", "Right, high", 1.0},
                                                       {"left_low", "Left, low", 0.4},
                                                       {"right_low", "Right, low", 0.6}}};

// Place in kSpatialCells; -1 for none.
int spatial_cell(const EpisodeRow& row, const OfferedHeights& heights) {
  const std::string& side = row.tags.text(kSideTag);
  const double height = row.tags.number(kHeightTag);
  if ((side != "left" && side != "right") || !std::isfinite(height)) return -1;
  return (height == heights.high ? 0 : 2) + (side == "left" ? 0 : 1);
}

// Success by the clip's variant, clean.
void add_spatial(const EpisodeRows& rows, const OfferedHeights& heights, double level, EstimatesOf of) {
  std::map<std::pair<int, std::string>, std::array<EpisodeRows, kSpatialCells.size()>> tasks;
  for (const auto& [id, row] : rows) {
    const int cell = spatial_cell(*row, heights);
    if (cell >= 0) tasks[{task_rank(id.task), id.task}][static_cast<std::size_t>(cell)].emplace(id, row);
  }
  for (const auto& [task, cells] : tasks) {
    of.keys.task = task.second;
    for (std::size_t i = 0; i < cells.size(); ++i) {
      of.keys.of = kSpatialCells[i].variant;
      of.rate("success", headline_rate(cells[i], level));
    }
  }
}

std::string seconds(const Estimate& of) {
  return std::isfinite(of.value) ? fmt::format("{:+.2f}", of.value + 0.0) : "-";
}

TitledTable timing_table(const Estimates& timing, double level) {
  return table_of(
      timing,
      {.title = "Reactivity: when the robot acts",
       .rows = policy_rows({kTaskLabel}),
       .columns = {column("n", {.name = "slope"}, as_n), column("Did not act", {.name = "did_not_act"}, as_count),
                   column("Slope", {.name = "slope"}, as_decimals(2)),
                   column("Median slope", {.name = "median_slope"}, as_decimals(2)),
                   column("Delay, clean [s]", {.name = "delay_clean"}, seconds),
                   column("Delay, partner moved [s]", {.name = "delay_moved"}, seconds),
                   column("False starts", {.name = "false_starts"}, as_count_of_n)},
       .notes = {fmt::format(
           "n: perturbed episodes whose partner's onset is {:g} s or more from that of the same episode clean. Slope: "
           "of the robot's onset shift over the partner's, least squares through the origin, with a {:g} % interval, "
           "clips drawn again; 1 follows its partner, 0 plays its clip. Median slope: the least absolute deviations, "
           "what most episodes do: an arm that swings with the steps can pass for an onset. Delay: median of the "
           "robot's onset minus its partner's; replay's is that of the demonstrations. Did not act: of such episodes, "
           "those without an onset of the robot, here or clean; they are in no slope. False starts: the robot begins "
           "more than {:g} s before its partner, of the episodes, clean too, in which both begin; by the rule "
           "interaction, which counts withdrawn beginnings, where it judged the run.",
           kPartnerShift, 100.0 * level, kFalseStart)}});
}

TitledTable spatial_table(const Estimates& spatial, const OfferedHeights& heights, double level) {
  Pivot pivot{
      .title = "Reactivity: where the partner's hand is (Table S10)", .rows = policy_rows({kTaskLabel}), .columns = {}};
  for (const SpatialCell& cell : kSpatialCells)
    pivot.columns.push_back(
        column(fmt::format("{} [%]", cell.title), {.of = cell.variant, .name = "success"}, as_percent));
  pivot.notes = {fmt::format(
      "Success in % of clean episodes under the headline detector with {:g} % Wilson intervals, by the hand "
      "and height that the partner offers: {:g} m is low, {:g} m high. The paper's row is Table S10 as printed: "
      "handshakes with a real robot, its number of trials not stated.",
      100.0 * level, heights.low, heights.high)};
  return table_of(spatial, pivot);
}

void add_papers_spatial(Estimates& into) {
  for (const SpatialCell& cell : kSpatialCells)
    EstimatesOf{{.source = "paper", .policy = "D-STAR", .task = "handshake", .of = cell.variant}, into}.add(
        "success", {}, cell.paper);
}

// Per engine and controller, as Figure S4.
std::vector<LinePlot> reactivity_plots(const Estimates& timing) {
  std::map<std::pair<std::string, std::string>, LinePlot> plots;
  for (const PivotRow& row : rows_of(timing, policy_rows({kTaskLabel}))) {
    const Estimate& keys = row.keys();
    if (keys.task != kAllTasks || row.find({.name = "partner_shift"}) == nullptr) continue;
    LinePlot& plot = plots[{keys.engine, keys.controller}];
    plot.title = fmt::format("Onset shifts: {} in {}", keys.controller, keys.engine);
    plot.x_label = "shift of the partner's onset [s]";
    plot.y_label = "of the robot's [s]";
    LineSeries& series = plot.series.emplace_back();
    series.name = policy_title(keys);
    for (const Estimate* estimate : row.estimates) {
      if (estimate->name == "partner_shift") series.x.push_back(estimate->value);
      if (estimate->name == "robot_shift") series.y.push_back(estimate->value);
    }
  }
  std::vector<LinePlot> list;
  list.reserve(plots.size());
  for (auto& [key, plot] : plots) list.push_back(std::move(plot));
  return list;
}

}  // namespace

Analysis reactivity_analysis(const std::vector<EpisodeRow>& rows, const IntervalOptions& options) {
  Estimates timing, spatial;
  ClusterBootstrap bootstrap(options.resamples, options.seed);
  const std::optional<OfferedHeights> heights = offered_heights(rows);
  for (const auto& [key, perturbed] : rows_of_policies(rows)) {
    const auto clean = perturbed.find(kClean);
    if (clean == perturbed.end()) continue;
    for (const auto& [task, of] : with_tasks(perturbed)) {
      EstimatesOf of_task = estimates_of(key, timing);
      of_task.keys.task = task;
      add_timing(of, options.level, bootstrap, of_task);
    }
    if (heights) add_spatial(clean->second, *heights, options.level, estimates_of(key, spatial));
  }
  if (!spatial.empty()) add_papers_spatial(spatial);
  Analysis analysis{.name = "reactivity", .title = "Reactivity", .level = options.level};
  if (!timing.empty()) analysis.tables.push_back(timing_table(timing, options.level));
  if (!spatial.empty()) analysis.tables.push_back(spatial_table(spatial, *heights, options.level));
  if (analysis.tables.empty())
    analysis.notes = {"No perturbation moved a partner's onset, and no variants of clips offer hands at two heights."};
  analysis.plots = {{.plots = reactivity_plots(timing)}};
  analysis.estimates = std::move(timing);
  std::ranges::move(spatial, std::back_inserter(analysis.estimates));
  return analysis;
}

}  // namespace duet
