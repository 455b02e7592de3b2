// Degradation as text, plots and for other programs.
#include <fmt/format.h>

#include <cmath>

#include "duet/results/analyses/degradation.h"
#include "duet/results/analyses/policy_table.h"
#include "duet/results/rows/json_fields.h"

namespace duet {
namespace {

constexpr const char* kNothing = "No policy ran both clean and perturbed.";

std::string difference_cell(const PairedDifference& difference) {
  if (std::isfinite(difference.interval.low)) return points(difference.difference, difference.interval);
  return std::isfinite(difference.difference) ? fmt::format("{:+.1f}", 100.0 * difference.difference) : "-";
}

std::string with_unit(double x, const std::string& unit) {
  return unit.empty() ? fmt::format("{:g}", x) : fmt::format("{:g} {}", x, unit);
}

std::string paper_sentence(const Degradation& result) {
  return result.paper.empty()
             ? ""
             : "The paper's rows are Table S9 as printed, over all tasks. " + paper_detector_sentence();
}

TitledTable success_table(const Degradation& result) {
  TitledTable titled = labelled_table("Perturbations: success and loss", labels_of(result.success));
  titled.table.header.insert(titled.table.header.end(), {"Perturbation", "n", "Success [%]", "Against clean [points]",
                                                         "Success, paper's detectors [%]"});
  ++titled.table.label_columns;
  for (std::size_t i = 0; i < result.success.size(); ++i) {
    const PerturbedSuccess& entry = result.success[i];
    std::vector<std::string>& cells = titled.table.rows[i];
    cells.insert(cells.end(), {entry.perturbation, fmt::format("{}", entry.success.n), rate_cell(entry.success),
                               difference_cell(entry.difference), rate_cell(entry.paper)});
  }
  titled.notes = {fmt::format(
      "Success under the headline detector with {0:g} % Wilson intervals. Against clean: the same episodes perturbed "
      "minus clean, with Newcombe's paired {0:g} % interval; where it contains 0 these episodes show no loss.",
      100.0 * result.level)};
  return titled;
}

void add_curve(const DegradationCurve& curve, std::vector<std::string>& cells) {
  cells.insert(cells.end(),
               {curve.family, std::isfinite(curve.normalised_area) ? fmt::format("{:.3f}", curve.normalised_area) : "-",
                with_unit(curve.largest, curve.unit), difference_cell(curve.difference)});
}

TitledTable curve_table(const Degradation& result) {
  TitledTable titled = labelled_table("Perturbations: curves", labels_of(result.curves));
  for (std::size_t i = 0; i < result.curves.size(); ++i) add_curve(result.curves[i], titled.table.rows[i]);
  for (const DegradationCurve& curve : result.paper) add_curve(curve, add_paper_row(curve.key.policy, titled));
  titled.table.header.insert(titled.table.header.end(), {"Family", "Area", "Largest", "Loss there [points]"});
  ++titled.table.label_columns;
  titled.notes = {
      "Area: under success over the size of the perturbation, from the clean episodes to the largest, over "
      "that of clean throughout; 1 is no loss."};
  if (!result.paper.empty()) titled.notes.push_back(paper_sentence(result));
  return titled;
}

LineSeries series_of(const std::string& name, const DegradationCurve& curve) {
  LineSeries series{.name = name, .x = {}, .y = {}};
  for (const CurvePoint& point : curve.points) {
    series.x.push_back(point.x);
    series.y.push_back(100.0 * point.success);
  }
  return series;
}

nlohmann::json json_of(const PairedDifference& difference) {
  return {{"pairs", difference.pairs},
          {"difference", number_or_null(difference.difference)},
          {"interval", json_of(difference.interval)}};
}

nlohmann::json json_of(const PerturbedSuccess& entry) {
  nlohmann::json json = json_of(entry.key);
  json["perturbation"] = entry.perturbation;
  json["success"] = json_of(entry.success);
  json["paper_success"] = json_of(entry.paper);
  json["against_clean"] = json_of(entry.difference);
  return json;
}

nlohmann::json json_of(const DegradationCurve& curve) {
  nlohmann::json points = nlohmann::json::array();
  for (const CurvePoint& point : curve.points) points.push_back({point.x, point.success});
  nlohmann::json json = json_of(curve.key);
  json["family"] = curve.family;
  json["unit"] = curve.unit;
  json["points"] = std::move(points);
  json["normalised_area"] = number_or_null(curve.normalised_area);
  json["largest"] = curve.largest;
  json["loss"] = json_of(curve.difference);
  return json;
}

void add_lines(const char* source, const DegradationCurve& curve, TextTable& lines) {
  add_figure_line(source, curve.key, curve.family, "normalised_area", static_cast<long>(curve.points.size()),
                  curve.normalised_area, kNoInterval, lines);
  add_figure_line(source, curve.key, curve.family, "loss_at_largest", curve.difference.pairs,
                  curve.difference.difference, curve.difference.interval, lines);
}

}  // namespace

std::vector<TitledTable> degradation_tables(const Degradation& result) {
  if (result.success.empty()) return {};
  std::vector<TitledTable> tables = {success_table(result)};
  if (!result.curves.empty()) tables.push_back(curve_table(result));
  return tables;
}

std::vector<LinePlot> degradation_plots(const Degradation& result) {
  std::map<std::vector<std::string>, LinePlot> plots;
  for (const DegradationCurve& curve : result.curves) {
    LinePlot& plot = plots[{curve.family, curve.unit, curve.key.engine, curve.key.controller}];
    if (plot.series.empty()) {
      plot.title = fmt::format("{}: {} in {}", curve.family, curve.key.controller, curve.key.engine);
      plot.x_label = curve.unit.empty() ? curve.family : fmt::format("{} [{}]", curve.family, curve.unit);
      plot.y_label = "success [%]";
    }
    plot.series.push_back(series_of(policy_name(curve.key), curve));
  }
  std::vector<LinePlot> list;
  for (auto& [key, plot] : plots) {
    for (const DegradationCurve& curve : result.paper)
      if (curve.family == key[0] && curve.unit == key[1])
        plot.series.push_back(series_of(curve.key.policy + " (the paper's)", curve));
    list.push_back(std::move(plot));
  }
  return list;
}

std::string degradation_markdown(const Degradation& result) {
  return result.success.empty() ? fmt::format("{}\n", kNothing) : tables_markdown(degradation_tables(result));
}

std::string degradation_csv(const Degradation& result) {
  TextTable lines = figure_lines("perturbation");
  for (const PerturbedSuccess& entry : result.success) {
    const auto line = [&](const char* figure, long n, double value, const Interval& interval) {
      add_figure_line("duet", entry.key, entry.perturbation, figure, n, value, interval, lines);
    };
    line("success", entry.success.n, entry.success.rate, entry.success.interval);
    if (entry.paper.n > 0) line("paper_success", entry.paper.n, entry.paper.rate, entry.paper.interval);
    if (entry.difference.pairs > 0)
      line("against_clean", entry.difference.pairs, entry.difference.difference, entry.difference.interval);
  }
  for (const DegradationCurve& curve : result.curves) add_lines("duet", curve, lines);
  for (const DegradationCurve& curve : result.paper) add_lines("paper", curve, lines);
  return csv_table(lines);
}

std::string degradation_latex(const Degradation& result) {
  return result.success.empty() ? fmt::format("% {}\n", kNothing) : tables_latex(degradation_tables(result));
}

nlohmann::json degradation_json(const Degradation& result) {
  nlohmann::json success = nlohmann::json::array();
  nlohmann::json curves = nlohmann::json::array();
  nlohmann::json paper = nlohmann::json::array();
  for (const PerturbedSuccess& entry : result.success) success.push_back(json_of(entry));
  for (const DegradationCurve& curve : result.curves) curves.push_back(json_of(curve));
  for (const DegradationCurve& curve : result.paper) paper.push_back(json_of(curve));
  return {{"schema", "duet.degradation/1"},
          {"level", result.level},
          {"success", std::move(success)},
          {"curves", std::move(curves)},
          {"paper", std::move(paper)}};
}

}  // namespace duet
