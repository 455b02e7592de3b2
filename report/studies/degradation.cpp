#include "duet/report/studies/degradation.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <set>
#include <tuple>

#include "duet/report/ranking/policy_table.h"

namespace duet {
namespace {

// As the rows' suite says it; none where it says no size.
std::optional<PerturbationSize> size_of_rows(const EpisodeRows& rows) {
  for (const auto& [id, row] : rows) {
    const double x = row->tags.number(kSizeTag);
    if (!std::isnan(x))
      return PerturbationSize{.family = row->tags.text(kFamilyTag),
                              .x = x,
                              .unit = row->tags.text(kUnitTag),
                              .beside = row->tags.text(kBesideTag)};
  }
  return std::nullopt;
}

// Clean, then by family and size, those without a size last by name.
auto place(const PerturbedSuccess& of) {
  const std::optional<PerturbationSize>& size = of.size;
  return std::make_tuple(of.perturbation != kClean, !size.has_value(), size ? size->family : "",
                         size ? size->beside : "", size ? size->x : 0.0, of.perturbation);
}

void finish(DegradationCurve& curve) {
  std::sort(curve.points.begin(), curve.points.end(),
            [](const CurvePoint& a, const CurvePoint& b) { return a.x < b.x; });
  double area = 0.0;
  double clean = 0.0;
  for (std::size_t i = 0; i < curve.points.size(); ++i) {
    const CurvePoint& point = curve.points[i];
    if (point.x == 0.0) clean = point.success;
    if (i == 0) continue;
    const CurvePoint& before = curve.points[i - 1];
    area += 0.5 * (point.success + before.success) * (point.x - before.x);
  }
  const double span = curve.points.back().x - curve.points.front().x;
  curve.normalised_area = clean > 0.0 ? area / (span * clean) : std::numeric_limits<double>::quiet_NaN();
}

// Families of the perturbations of one policy, each with its clean point.
std::vector<DegradationCurve> curves_of(const PolicyKey& key, const std::vector<PerturbedSuccess>& success) {
  std::map<std::array<std::string, 3>, DegradationCurve> curves;  // by family, unit and what stands beside the size
  std::map<std::string, std::set<std::string>> besides;
  for (const PerturbedSuccess& entry : success) {
    const std::optional<PerturbationSize>& size = entry.size;
    if (!size || size->x == 0.0 || entry.success.n == 0) continue;
    besides[size->family].insert(size->beside);
    DegradationCurve& curve = curves[{size->family, size->unit, size->beside}];
    if (curve.points.empty()) curve.points.push_back({0.0, success.front().success.rate});
    curve.points.push_back({size->x, entry.success.rate});
    if (std::abs(size->x) < std::abs(curve.largest)) continue;
    curve.largest = size->x;
    curve.difference = entry.difference;
  }
  std::vector<DegradationCurve> list;
  for (auto& [name, curve] : curves) {
    const auto& [family, unit, beside] = name;
    curve.key = key;
    curve.family = besides.at(family).size() == 1 ? family : fmt::format("{} ({})", family, beside);
    curve.unit = unit;
    finish(curve);
    list.push_back(std::move(curve));
  }
  return list;
}

std::vector<PerturbedSuccess> success_of(const PolicyKey& key, const PerturbedRows& rows, double level) {
  const EpisodeRows& clean = rows.find(kClean)->second;
  std::vector<PerturbedSuccess> success;
  for (const auto& [perturbation, episodes] : rows) {
    success.push_back({.key = key,
                       .perturbation = perturbation,
                       .size = size_of_rows(episodes),
                       .success = headline_rate(episodes, level),
                       .paper = verdict_rate(episodes, "paper", "paper", level),
                       .difference = {}});
    if (perturbation != kClean) success.back().difference = paired_difference(episodes, clean, level);
  }
  std::ranges::sort(success, {}, place);
  return success;
}

// Table S9's curve of a family; without points where it has none.
DegradationCurve paper_curve(const std::string& family, const std::string& unit) {
  DegradationCurve curve;
  curve.key.policy = "D-STAR";
  curve.family = family;
  curve.unit = unit;
  const double clean = paper_policies().front().overall / 100.0;
  for (const PaperPolicy& paper : paper_policies()) {
    if (paper.family != family) continue;
    if (curve.points.empty()) curve.points.push_back({0.0, clean});
    curve.points.push_back({paper.size, paper.overall / 100.0});
    curve.largest = paper.size;
    curve.difference.difference = paper.overall / 100.0 - clean;
  }
  if (!curve.points.empty()) finish(curve);
  return curve;
}

std::vector<DegradationCurve> paper_curves(const std::vector<DegradationCurve>& ours) {
  std::set<std::pair<std::string, std::string>> families;
  for (const DegradationCurve& curve : ours) families.emplace(curve.family, curve.unit);
  std::vector<DegradationCurve> curves;
  for (const auto& [family, unit] : families) {
    if (unit != (family == "jitter" ? "m" : "")) continue;
    if (DegradationCurve curve = paper_curve(family, unit); !curve.points.empty()) curves.push_back(std::move(curve));
  }
  return curves;
}

std::string with_unit(double x, const std::string& unit) {
  return unit.empty() ? fmt::format("{:g}", x) : fmt::format("{:g} {}", x, unit);
}

std::string paper_curves_sentence(const Degradation& result) {
  return result.paper.empty()
             ? ""
             : "The paper's rows are Table S9 as printed, over all tasks. " + paper_detector_sentence();
}

TitledTable perturbed_table(const Degradation& result) {
  TitledTable titled = labelled_table("Perturbations: success and loss", labels_of(result.success));
  titled.table.header.insert(titled.table.header.end(), {"Perturbation", "n", "Success [%]", "Against clean [points]",
                                                         "Success, paper's detectors [%]"});
  ++titled.table.label_columns;
  for (std::size_t i = 0; i < result.success.size(); ++i) {
    const PerturbedSuccess& entry = result.success[i];
    std::vector<std::string>& cells = titled.table.rows[i];
    cells.insert(cells.end(), {entry.perturbation, count_cell(entry.success.n), rate_cell(entry.success),
                               points(entry.difference.difference, entry.difference.interval), rate_cell(entry.paper)});
  }
  titled.notes = {fmt::format(
      "Success under the headline detector with {0:g} % Wilson intervals. Against clean: the same episodes perturbed "
      "minus clean, with Newcombe's paired {0:g} % interval; where it contains 0 these episodes show no loss.",
      100.0 * result.level)};
  return titled;
}

void add_curve_cells(const DegradationCurve& curve, std::vector<std::string>& cells) {
  cells.insert(cells.end(), {curve.family, decimals(curve.normalised_area, 3), with_unit(curve.largest, curve.unit),
                             points(curve.difference.difference, curve.difference.interval)});
}

TitledTable curve_table(const Degradation& result) {
  TitledTable titled = labelled_table("Perturbations: curves", labels_of(result.curves));
  for (std::size_t i = 0; i < result.curves.size(); ++i) add_curve_cells(result.curves[i], titled.table.rows[i]);
  for (const DegradationCurve& curve : result.paper) add_curve_cells(curve, add_paper_row(curve.key.policy, titled));
  titled.table.header.insert(titled.table.header.end(), {"Family", "Area", "Largest", "Loss there [points]"});
  ++titled.table.label_columns;
  titled.notes = {
      "Area: under success over the size of the perturbation, from the clean episodes to the largest, over "
      "that of clean throughout; 1 is no loss. Sizes are what the suite runs, in SI units, whatever names say."};
  if (!result.paper.empty()) titled.notes.push_back(paper_curves_sentence(result));
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

void add_success_figures(const PerturbedSuccess& entry, std::vector<Figure>& into) {
  FiguresOf figures = figures_of(entry.key, into);
  figures.keys.perturbation = entry.perturbation;
  figures.rate("success", entry.success);
  if (entry.paper.n > 0) figures.rate("paper_success", entry.paper);
  if (entry.difference.pairs > 0) add_difference("against_clean", entry.difference, figures);
  if (!entry.size) return;
  figures.keys.of = entry.size->family;
  figures.add("size", {}, entry.size->x, kNoInterval, entry.size->unit);
}

void add_curve_figures(const DegradationCurve& curve, FiguresOf figures) {
  figures.keys.of = curve.family;
  figures.add("normalised_area", static_cast<long>(curve.points.size()), curve.normalised_area);
  figures.add("largest", {}, curve.largest, kNoInterval, curve.unit);
  add_difference("loss_at_largest", curve.difference, figures);
}

// The paper's perturbations are called after family and size: "jitter_0.01m".
void add_paper_figures(const DegradationCurve& curve, std::vector<Figure>& into) {
  FiguresOf figures = paper_figures_of(curve.key.policy, into);
  add_curve_figures(curve, figures);
  figures.keys.of = curve.family;
  for (const CurvePoint& point : curve.points) {
    figures.keys.perturbation = point.x == 0.0 ? kClean : fmt::format("{}_{:g}{}", curve.family, point.x, curve.unit);
    figures.add("success", {}, point.success);
    figures.add("size", {}, point.x, kNoInterval, curve.unit);
  }
}

}  // namespace

Degradation degradation(const std::vector<EpisodeRow>& rows, const IntervalOptions& options) {
  Degradation result{.level = options.level, .success = {}, .curves = {}, .paper = {}};
  for (const auto& [key, perturbed] : rows_of_policies(rows)) {
    if (perturbed.size() < 2 || !perturbed.contains(kClean)) continue;
    std::vector<PerturbedSuccess> success = success_of(key, perturbed, options.level);
    for (DegradationCurve& curve : curves_of(key, success)) result.curves.push_back(std::move(curve));
    result.success.insert(result.success.end(), success.begin(), success.end());
  }
  result.paper = paper_curves(result.curves);
  return result;
}

Analysis degradation_analysis(const Degradation& result) {
  Analysis analysis{.name = "degradation", .title = "Perturbations", .level = result.level};
  if (result.success.empty()) {
    analysis.notes = {"No policy ran both clean and perturbed."};
    return analysis;
  }
  analysis.tables = {perturbed_table(result)};
  if (!result.curves.empty()) analysis.tables.push_back(curve_table(result));
  analysis.plots = {{.plots = degradation_plots(result)}};
  for (const PerturbedSuccess& entry : result.success) add_success_figures(entry, analysis.figures);
  for (const DegradationCurve& curve : result.curves) add_curve_figures(curve, figures_of(curve.key, analysis.figures));
  for (const DegradationCurve& curve : result.paper) add_paper_figures(curve, analysis.figures);
  return analysis;
}

}  // namespace duet
