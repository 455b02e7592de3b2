// Reactivity as text, plots and for other programs.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "duet/results/analyses/reactivity.h"
#include "duet/results/rows/json_fields.h"

namespace duet {
namespace {

constexpr const char* kNothing = "No perturbation moved a partner's onset, and no clip names a spatial variant.";

std::string seconds(double value) { return std::isfinite(value) ? fmt::format("{:+.2f}", value + 0.0) : "-"; }

std::string slope_cell(const Reactivity& of) {
  if (!std::isfinite(of.slope)) return "-";
  if (!std::isfinite(of.interval.low)) return fmt::format("{:.2f}", of.slope + 0.0);
  return fmt::format("{:.2f} [{:.2f}, {:.2f}]", of.slope + 0.0, of.interval.low + 0.0, of.interval.high + 0.0);
}

TitledTable timing_table(const ReactivityTable& table) {
  TitledTable titled = labelled_table("Reactivity: when the robot acts", labels_of(table.timing));
  titled.table.header.insert(titled.table.header.end(),
                             {"n", "Did not act", "Slope", "Delay, clean [s]", "Delay, partner moved [s]"});
  for (std::size_t i = 0; i < table.timing.size(); ++i) {
    const Reactivity& of = table.timing[i];
    titled.table.rows[i].insert(titled.table.rows[i].end(),
                                {fmt::format("{}", of.n), fmt::format("{}", of.without), slope_cell(of),
                                 seconds(of.delay_clean), seconds(of.delay_moved)});
  }
  titled.notes = {fmt::format(
      "n: perturbed episodes whose partner's onset is {:g} s or more from that of the same episode clean. Slope: of "
      "the "
      "robot's onset shift over the partner's, least squares through the origin, with a {:g} % interval, clips drawn "
      "again; 1 follows its partner, 0 plays its clip. Delay: median of the robot's onset minus its partner's. Did not "
      "act: of such episodes, those without an onset of the robot, here or clean; they are in no slope.",
      kPartnerShift, 100.0 * table.level)};
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
      "and height that the partner offers. The paper's row is Table S10 as printed: handshakes with a real "
      "robot, its number of trials not stated.",
      100.0 * table.level)};
  return titled;
}

nlohmann::json json_of(const Reactivity& of) {
  nlohmann::json shifts = nlohmann::json::array();
  for (const OnsetShift& shift : of.shifts)
    shifts.push_back(
        {{"perturbation", shift.perturbation}, {"n", shift.n}, {"partner_s", shift.partner}, {"robot_s", shift.robot}});
  nlohmann::json json = json_of(of.key);
  json["n"] = of.n;
  json["did_not_act"] = of.without;
  json["slope"] = number_or_null(of.slope);
  json["interval"] = json_of(of.interval);
  json["n_clean"] = of.n_clean;
  json["delay_clean_s"] = number_or_null(of.delay_clean);
  json["delay_moved_s"] = number_or_null(of.delay_moved);
  json["shifts"] = std::move(shifts);
  return json;
}

nlohmann::json json_of(const SpatialCells& of) {
  nlohmann::json cells = nlohmann::json::object();
  for (std::size_t i = 0; i < kSpatialCells.size(); ++i)
    cells[std::string(kSpatialCells[i].variant)] = json_of(of.cells[i]);
  nlohmann::json json = json_of(of.key);
  json["task"] = of.task;
  json["success"] = std::move(cells);
  return json;
}

}  // namespace

std::vector<TitledTable> reactivity_tables(const ReactivityTable& table) {
  std::vector<TitledTable> tables;
  if (!table.timing.empty()) tables.push_back(timing_table(table));
  if (!table.spatial.empty()) tables.push_back(spatial_table(table));
  return tables;
}

std::vector<LinePlot> reactivity_plots(const ReactivityTable& table) {
  std::map<std::pair<std::string, std::string>, LinePlot> plots;
  for (const Reactivity& of : table.timing) {
    if (of.shifts.empty()) continue;
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

std::string reactivity_markdown(const ReactivityTable& table) {
  return table.empty() ? fmt::format("{}\n", kNothing) : tables_markdown(reactivity_tables(table));
}

std::string reactivity_csv(const ReactivityTable& table) {
  TextTable lines = figure_lines("task");
  for (const Reactivity& of : table.timing) {
    add_figure_line("duet", of.key, "all", "slope", of.n, of.slope, of.interval, lines);
    add_figure_line("duet", of.key, "all", "did_not_act", of.n + of.without, static_cast<double>(of.without),
                    kNoInterval, lines);
    add_figure_line("duet", of.key, "all", "delay_clean_s", of.n_clean, of.delay_clean, kNoInterval, lines);
    add_figure_line("duet", of.key, "all", "delay_moved_s", of.n, of.delay_moved, kNoInterval, lines);
  }
  for (const SpatialCells& of : table.spatial)
    for (std::size_t i = 0; i < kSpatialCells.size(); ++i)
      add_figure_line("duet", of.key, of.task, kSpatialCells[i].variant, of.cells[i].n, of.cells[i].rate,
                      of.cells[i].interval, lines);
  if (!table.spatial.empty())
    for (const SpatialCell& cell : kSpatialCells)
      lines.rows.push_back(
          {"paper", "", "", "", "D-STAR", "handshake", std::string(cell.variant), "", number_cell(cell.paper), "", ""});
  return csv_table(lines);
}

std::string reactivity_latex(const ReactivityTable& table) {
  return table.empty() ? fmt::format("% {}\n", kNothing) : tables_latex(reactivity_tables(table));
}

nlohmann::json reactivity_json(const ReactivityTable& table) {
  nlohmann::json timing = nlohmann::json::array();
  nlohmann::json spatial = nlohmann::json::array();
  nlohmann::json paper = nlohmann::json::object();
  for (const Reactivity& of : table.timing) timing.push_back(json_of(of));
  for (const SpatialCells& of : table.spatial) spatial.push_back(json_of(of));
  for (const SpatialCell& cell : kSpatialCells) paper[std::string(cell.variant)] = cell.paper;
  return {{"schema", "duet.reactivity/1"},
          {"level", table.level},
          {"timing", std::move(timing)},
          {"spatial", std::move(spatial)},
          {"paper_spatial", std::move(paper)}};
}

}  // namespace duet
