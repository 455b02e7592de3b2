#include "duet/report/studies/reactivity.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <optional>
#include <set>

#include "duet/core/episode_tags.h"
#include "duet/core/order_statistics.h"
#include "duet/report/studies/interaction_table.h"
#include "duet/rows/groups/row_groups.h"

namespace duet {
namespace {

constexpr const char* kAllTasks = "all";
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

void count_false_starts(const PerturbedRows& rows, Reactivity& of) {
  for (const auto& [perturbation, episodes] : rows)
    for (const auto& [id, row] : episodes)
      if (const std::optional<double> lead = lead_of(*row)) {
        ++of.led;
        of.false_starts += *lead > kFalseStart ? 1 : 0;
      }
}

Reactivity timing_of(const PolicyKey& key, const std::string& task, const PerturbedRows& rows,
                     ClusterBootstrap& bootstrap, double level) {
  const EpisodeRows& clean = rows.find(kClean)->second;
  Reactivity of;
  of.key = key;
  of.task = task;
  GatheredShifts gathered;
  for (const auto& [perturbation, episodes] : rows) {
    if (perturbation == kClean) continue;
    OnsetShift shift = gather(perturbation, episodes, clean, gathered);
    if (shift.n > 0) of.shifts.push_back(std::move(shift));
  }
  std::stable_sort(of.shifts.begin(), of.shifts.end(),
                   [](const OnsetShift& a, const OnsetShift& b) { return a.partner < b.partner; });
  of.n = static_cast<long>(gathered.products.size());
  of.without = gathered.without;
  of.slope = of.n > 0 ? sum(gathered.products) / sum(gathered.squares) : kNoReaction;
  of.median_slope = weighted_median(gathered.ratios, gathered.sizes);
  const bool several = gathered.numbers.size() > 1;
  of.interval = several ? bootstrap.ratio(gathered.products, gathered.squares, gathered.clips, level) : kNoInterval;
  of.median_interval =
      several ? bootstrap.weighted_median(gathered.ratios, gathered.sizes, gathered.clips, level) : kNoInterval;
  std::vector<double> delays = delays_of(clean);
  of.n_clean = static_cast<long>(delays.size());
  of.delay_clean = quantile(std::move(delays), 0.5);
  of.delay_moved = quantile(std::move(gathered.delays), 0.5);
  count_false_starts(rows, of);
  return of;
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

// None unless the variants of clips have two heights.
std::optional<OfferedHeights> offered_heights(const std::vector<EpisodeRow>& rows) {
  std::set<double> heights;
  for (const EpisodeRow& row : rows)
    if (const double height = row.tags.number(kHeightTag); std::isfinite(height)) heights.insert(height);
  if (heights.size() != 2) return std::nullopt;
  return OfferedHeights{.low = *heights.begin(), .high = *heights.rbegin()};
}

// Place in kSpatialCells; -1 for none.
int spatial_cell(const EpisodeRow& row, const OfferedHeights& heights) {
  const std::string& side = row.tags.text(kSideTag);
  const double height = row.tags.number(kHeightTag);
  if ((side != "left" && side != "right") || !std::isfinite(height)) return -1;
  return (height == heights.high ? 0 : 2) + (side == "left" ? 0 : 1);
}

std::vector<SpatialCells> spatial_of(const PolicyKey& key, const EpisodeRows& rows, const OfferedHeights& heights,
                                     double level) {
  std::map<std::pair<int, std::string>, std::array<EpisodeRows, 4>> tasks;
  for (const auto& [id, row] : rows) {
    const int cell = spatial_cell(*row, heights);
    if (cell >= 0) tasks[{task_rank(id.task), id.task}][static_cast<std::size_t>(cell)].emplace(id, row);
  }
  std::vector<SpatialCells> spatial;
  for (const auto& [task, cells] : tasks) {
    SpatialCells of{.key = key, .task = task.second, .cells = {}};
    for (std::size_t i = 0; i < cells.size(); ++i) of.cells[i] = headline_rate(cells[i], level);
    spatial.push_back(std::move(of));
  }
  return spatial;
}

std::string seconds(double value) { return std::isfinite(value) ? fmt::format("{:+.2f}", value + 0.0) : "-"; }

TitledTable timing_table(const ReactivityTable& table) {
  TitledTable titled = labelled_table("Reactivity: when the robot acts", labels_of(table.timing));
  titled.table.header.insert(titled.table.header.end(),
                             {"Task", "n", "Did not act", "Slope", "Median slope", "Delay, clean [s]",
                              "Delay, partner moved [s]", "False starts"});
  ++titled.table.label_columns;
  for (std::size_t i = 0; i < table.timing.size(); ++i) {
    const Reactivity& of = table.timing[i];
    titled.table.rows[i].insert(
        titled.table.rows[i].end(),
        {task_title(of.task), count_cell(of.n), count_cell(of.without), decimals(of.slope, of.interval, 2),
         decimals(of.median_slope, of.median_interval, 2), seconds(of.delay_clean), seconds(of.delay_moved),
         of.led > 0 ? fmt::format("{}/{}", of.false_starts, of.led) : "-"});
  }
  titled.notes = {fmt::format(
      "n: perturbed episodes whose partner's onset is {:g} s or more from that of the same episode clean. Slope: of "
      "the robot's onset shift over the partner's, least squares through the origin, with a {:g} % interval, clips "
      "drawn again; 1 follows its partner, 0 plays its clip. Median slope: the least absolute deviations, what most "
      "episodes do: an arm that swings with the steps can pass for an onset. Delay: median of the robot's onset minus "
      "its partner's; replay's is that of the demonstrations. Did not act: of such episodes, those without an onset of "
      "the robot, here or clean; they are in no slope. False starts: the robot begins more than {:g} s before its "
      "partner, of the episodes, clean too, in which both begin; by the rule interaction, which counts withdrawn "
      "beginnings, where it judged the run.",
      kPartnerShift, 100.0 * table.level, kFalseStart)};
  return titled;
}

TitledTable spatial_table(const ReactivityTable& table) {
  TitledTable titled = labelled_table("Reactivity: where the partner's hand is (Table S10)", labels_of(table.spatial));
  titled.table.header.emplace_back("Task");
  ++titled.table.label_columns;
  for (const SpatialCell& cell : kSpatialCells) titled.table.header.push_back(fmt::format("{} [%]", cell.title));
  for (std::size_t i = 0; i < table.spatial.size(); ++i) {
    std::vector<std::string>& cells = titled.table.rows[i];
    cells.push_back(task_title(table.spatial[i].task));
    for (const Rate& rate : table.spatial[i].cells) cells.push_back(rate_cell(rate));
  }
  --titled.table.label_columns;
  std::vector<std::string>& paper = add_paper_row("D-STAR", titled);
  ++titled.table.label_columns;
  paper.push_back(task_title("handshake"));
  for (const SpatialCell& cell : kSpatialCells) paper.push_back(percent(cell.paper));
  titled.notes = {fmt::format(
      "Success in % of clean episodes under the headline detector with {:g} % Wilson intervals, by the hand "
      "and height that the partner offers: {:g} m is low, {:g} m high. The paper's row is Table S10 as printed: "
      "handshakes with a real robot, its number of trials not stated.",
      100.0 * table.level, table.heights.low, table.heights.high)};
  return titled;
}

std::vector<LinePlot> reactivity_plots(const ReactivityTable& table) {
  std::map<std::pair<std::string, std::string>, LinePlot> plots;
  for (const Reactivity& of : table.timing) {
    if (of.shifts.empty() || of.task != kAllTasks) continue;
    LinePlot& plot = plots[{of.key.engine, of.key.controller}];
    plot.title = fmt::format("Onset shifts: {} in {}", of.key.controller, of.key.engine);
    plot.x_label = "shift of the partner's onset [s]";
    plot.y_label = "of the robot's [s]";
    LineSeries& series = plot.series.emplace_back();
    series.name = policy_name(of.key);
    for (const OnsetShift& shift : of.shifts) {
      series.x.push_back(shift.partner);
      series.y.push_back(shift.robot);
    }
  }
  std::vector<LinePlot> list;
  list.reserve(plots.size());
  for (auto& [key, plot] : plots) list.push_back(std::move(plot));
  return list;
}

void add_timing_figures(const Reactivity& of, std::vector<Figure>& into) {
  FiguresOf figures = figures_of(of.key, into);
  figures.keys.task = of.task;
  figures.add("slope", of.n, of.slope, of.interval);
  figures.add("median_slope", of.n, of.median_slope, of.median_interval);
  figures.count("did_not_act", of.n + of.without, of.without);
  figures.add("delay_clean", of.n_clean, of.delay_clean, kNoInterval, "s");
  figures.add("delay_moved", of.n, of.delay_moved, kNoInterval, "s");
  figures.count("false_starts", of.led, of.false_starts);
  for (const OnsetShift& shift : of.shifts) {
    figures.keys.perturbation = shift.perturbation;
    figures.add("partner_shift", shift.n, shift.partner, kNoInterval, "s");
    figures.add("robot_shift", shift.n, shift.robot, kNoInterval, "s");
  }
}

void add_spatial_figures(const std::vector<SpatialCells>& spatial, std::vector<Figure>& into) {
  for (const SpatialCells& of : spatial) {
    FiguresOf figures = figures_of(of.key, into);
    figures.keys.task = of.task;
    for (std::size_t i = 0; i < kSpatialCells.size(); ++i) {
      figures.keys.of = kSpatialCells[i].variant;
      figures.rate("success", of.cells[i]);
    }
  }
  if (spatial.empty()) return;
  FiguresOf figures = paper_figures_of("D-STAR", into);
  figures.keys.task = "handshake";
  for (const SpatialCell& cell : kSpatialCells) {
    figures.keys.of = cell.variant;
    figures.add("success", {}, cell.paper);
  }
}

}  // namespace

ReactivityTable reactivity_table(const std::vector<EpisodeRow>& rows, const IntervalOptions& options) {
  ReactivityTable table{.level = options.level, .timing = {}, .spatial = {}};
  ClusterBootstrap bootstrap(options.resamples, options.seed);
  const std::optional<OfferedHeights> heights = offered_heights(rows);
  table.heights = heights.value_or(OfferedHeights());
  for (const auto& [key, perturbed] : rows_of_policies(rows)) {
    const auto clean = perturbed.find(kClean);
    if (clean == perturbed.end()) continue;
    for (const auto& [task, of] : with_tasks(perturbed)) {
      Reactivity timing = timing_of(key, task, of, bootstrap, options.level);
      if (timing.n + timing.without > 0) table.timing.push_back(std::move(timing));
    }
    if (!heights) continue;
    for (SpatialCells& cells : spatial_of(key, clean->second, *heights, options.level))
      table.spatial.push_back(std::move(cells));
  }
  return table;
}

Analysis reactivity_analysis(const ReactivityTable& table) {
  Analysis analysis{.name = "reactivity", .title = "Reactivity", .level = table.level};
  if (table.empty())
    analysis.notes = {"No perturbation moved a partner's onset, and no variants of clips offer hands at two heights."};
  if (!table.timing.empty()) analysis.tables.push_back(timing_table(table));
  if (!table.spatial.empty()) analysis.tables.push_back(spatial_table(table));
  analysis.plots = {{.plots = reactivity_plots(table)}};
  for (const Reactivity& of : table.timing) add_timing_figures(of, analysis.figures);
  add_spatial_figures(table.spatial, analysis.figures);
  return analysis;
}

}  // namespace duet
