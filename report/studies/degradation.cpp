#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <optional>
#include <set>
#include <tuple>

#include "duet/core/require.h"
#include "duet/core/task.h"
#include "duet/report/ranking/policy_groups.h"
#include "duet/report/ranking/policy_table.h"
#include "duet/report/studies/studies.h"

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

struct PerturbedEpisodes {
  std::string perturbation;
  std::optional<PerturbationSize> size;
  const EpisodeRows* rows = nullptr;
};

// Clean, then by family and size, those without a size last by name.
std::vector<PerturbedEpisodes> in_table_order(const PerturbedRows& rows) {
  std::vector<PerturbedEpisodes> order;
  for (const auto& [perturbation, episodes] : rows) order.push_back({perturbation, size_of_rows(episodes), &episodes});
  std::ranges::sort(order, {}, [](const PerturbedEpisodes& of) {
    const std::optional<PerturbationSize>& size = of.size;
    return std::make_tuple(of.perturbation != kClean, !size.has_value(), size ? size->family : "",
                           size ? size->beside : "", size ? size->x : 0.0, of.perturbation);
  });
  return order;
}

struct CurvePoint {
  double x = 0.0, success = 0.0;
};

// One family in one (engine, controller, arm, policy); clean is the point at 0.
struct DegradationCurve {
  Estimate keys;
  std::string family, unit;
  std::vector<CurvePoint> points = {};  // by x, at least two
  double largest = 0.0;                 // the x that is furthest from 0
  PairedDifference difference = {};     // there, to clean; the paper's: no interval
};

// The mean of success over the span of x (trapezia) over that of clean: 1 = no loss. NaN where clean never succeeds.
double normalised_area(const std::vector<CurvePoint>& points) {
  double area = 0.0, clean = 0.0;
  for (std::size_t i = 0; i < points.size(); ++i) {
    if (points[i].x == 0.0) clean = points[i].success;
    if (i > 0) area += 0.5 * (points[i].success + points[i - 1].success) * (points[i].x - points[i - 1].x);
  }
  const double span = points.back().x - points.front().x;
  return clean > 0.0 ? area / (span * clean) : std::numeric_limits<double>::quiet_NaN();
}

// Curves by family, unit and what stands beside the size.
using CurvesOfPolicy = std::map<std::array<std::string, 3>, DegradationCurve>;

// Adds success under each perturbation, and the points of curves.
void add_success(const std::vector<PerturbedEpisodes>& perturbations, double level, EstimatesOf of,
                 CurvesOfPolicy& curves) {
  double clean = 0.0;
  for (const PerturbedEpisodes& each : perturbations) {
    const Rate success = headline_rate(*each.rows, level), paper = verdict_rate(*each.rows, "paper", "paper", level);
    PairedDifference difference;
    if (each.perturbation == kClean)
      clean = success.rate;
    else
      difference = paired_difference(*each.rows, *perturbations.front().rows, level);
    of.keys.perturbation = each.perturbation;
    of.keys.of = "";
    of.rate("success", success);
    if (paper.n > 0) of.rate("paper_success", paper);
    if (difference.pairs > 0) add_difference("against_clean", difference, of);
    if (!each.size) continue;
    const PerturbationSize& size = *each.size;
    of.keys.of = size.family;
    of.add("size", {}, size.x, kNoInterval, size.unit);
    if (size.x == 0.0) continue;
    DegradationCurve& curve = curves[{size.family, size.unit, size.beside}];
    if (curve.points.empty()) curve.points.push_back({0.0, clean});
    curve.points.push_back({size.x, success.rate});
    if (std::abs(size.x) < std::abs(curve.largest)) continue;
    curve.largest = size.x;
    curve.difference = difference;
  }
}

// Finished: points by x, with the names of families.
std::vector<DegradationCurve> finished(const PolicyKey& key, CurvesOfPolicy&& curves) {
  std::map<std::string, std::set<std::string>> besides;
  for (const auto& [name, curve] : curves) besides[name[0]].insert(name[2]);
  std::vector<DegradationCurve> list;
  for (auto& [name, curve] : curves) {
    const auto& [family, unit, beside] = name;
    curve.keys = keys_of(key);
    curve.family = besides.at(family).size() == 1 ? family : fmt::format("{} ({})", family, beside);
    curve.unit = unit;
    std::ranges::sort(curve.points, {}, &CurvePoint::x);
    list.push_back(std::move(curve));
  }
  return list;
}

// Table S9's curves of the families that occur in ours.
std::vector<DegradationCurve> paper_curves(const std::vector<DegradationCurve>& ours) {
  std::set<std::pair<std::string, std::string>> families;
  for (const DegradationCurve& curve : ours) families.emplace(curve.family, curve.unit);
  const double clean = paper_policies().front().overall / 100.0;
  std::vector<DegradationCurve> curves;
  for (const auto& [family, unit] : families) {
    if (unit != (family == "jitter" ? "m" : "")) continue;
    DegradationCurve curve{{.source = "paper", .policy = "D-STAR"}, family, unit, {{0.0, clean}}};
    for (const PaperPolicy& paper : paper_policies()) {
      if (paper.family != family) continue;
      curve.points.push_back({paper.size, paper.overall / 100.0});
      curve.largest = paper.size;
      curve.difference.difference = paper.overall / 100.0 - clean;
    }
    if (curve.points.size() > 1) curves.push_back(std::move(curve));
  }
  return curves;
}

void add_curve(const DegradationCurve& curve, Estimates& into) {
  EstimatesOf of{curve.keys, into};
  of.keys.of = curve.family;
  of.add("normalised_area", static_cast<long>(curve.points.size()), normalised_area(curve.points));
  of.add("largest", {}, curve.largest, kNoInterval, curve.unit);
  add_difference("loss_at_largest", curve.difference, of);
  if (curve.keys.source != "paper") return;
  // The paper's perturbations are called after family and size: "jitter_0.01m".
  for (const CurvePoint& point : curve.points) {
    of.keys.perturbation = point.x == 0.0 ? kClean : fmt::format("{}_{:g}{}", curve.family, point.x, curve.unit);
    of.add("success", {}, point.success);
    of.add("size", {}, point.x, kNoInterval, curve.unit);
  }
}

TitledTable perturbed_table(const Estimates& success, double level) {
  return table_of(
      success,
      {.title = "Perturbations: success and loss",
       .rows = policy_rows({{"Perturbation", &Estimate::perturbation, true}}),
       .columns = {column("n", {.name = "success"}, as_n), column("Success [%]", {.name = "success"}, as_percent),
                   column("Against clean [points]", {.name = "against_clean"}, as_points),
                   column("Success, paper's detectors [%]", {.name = "paper_success"}, as_percent)},
       .notes = {fmt::format(
           "Success under the headline detector with {0:g} % Wilson intervals. Against clean: the same episodes "
           "perturbed minus clean, with Newcombe's paired {0:g} % interval; where it contains 0 these episodes show no "
           "loss.",
           100.0 * level)}});
}

TitledTable curve_table(const Estimates& curves, bool with_paper) {
  Pivot pivot{
      .title = "Perturbations: curves",
      .rows = policy_rows({{"Family", &Estimate::of, true}}),
      .columns = {column("Area", {.name = "normalised_area"}, as_decimals(3)),
                  column("Largest", {.name = "largest"},
                         [](const Estimate& of) {
                           return fmt::format("{:g}{}{}", of.value, of.unit.empty() ? "" : " ", of.unit);
                         }),
                  column("Loss there [points]", {.name = "loss_at_largest"}, as_points)},
      .notes = {
          "Area: under success over the size of the perturbation, from the clean episodes to the largest, over "
          "that of clean throughout; 1 is no loss. Sizes are what the suite runs, in SI units, whatever names say."}};
  if (with_paper)
    pivot.notes.push_back("The paper's rows are Table S9 as printed, over all tasks. " + paper_detector_sentence());
  return table_of(curves, pivot);
}

LineSeries series_of(const DegradationCurve& curve) {
  LineSeries series{.name = label_text(curve.keys, &Estimate::policy), .x = {}, .y = {}};
  for (const CurvePoint& point : curve.points) {
    series.x.push_back(point.x);
    series.y.push_back(100.0 * point.success);
  }
  return series;
}

// Per family, engine and controller.
std::vector<LinePlot> degradation_plots(const std::vector<DegradationCurve>& curves,
                                        const std::vector<DegradationCurve>& papers) {
  std::map<std::array<std::string, 4>, LinePlot> plots;
  for (const DegradationCurve& curve : curves) {
    LinePlot& plot = plots[{curve.family, curve.unit, curve.keys.engine, curve.keys.controller}];
    plot.title = fmt::format("{}: {} in {}", curve.family, curve.keys.controller, curve.keys.engine);
    plot.x_label = curve.unit.empty() ? curve.family : fmt::format("{} [{}]", curve.family, curve.unit);
    plot.y_label = "success [%]";
    plot.series.push_back(series_of(curve));
  }
  std::vector<LinePlot> list;
  for (auto& [key, plot] : plots) {
    for (const DegradationCurve& curve : papers)
      if (curve.family == key[0] && curve.unit == key[1]) plot.series.push_back(series_of(curve));
    list.push_back(std::move(plot));
  }
  return list;
}

}  // namespace

Analysis degradation_analysis(const std::vector<EpisodeRow>& rows, const IntervalOptions& options) {
  Analysis analysis{.name = "degradation", .title = "Perturbations", .level = options.level};
  std::vector<DegradationCurve> curves;
  for (const auto& [key, perturbed] : rows_of_policies(rows)) {
    if (perturbed.size() < 2 || !perturbed.contains(kClean)) continue;
    CurvesOfPolicy of_policy;
    add_success(in_table_order(perturbed), options.level, estimates_of(key, analysis.estimates), of_policy);
    std::ranges::move(finished(key, std::move(of_policy)), std::back_inserter(curves));
  }
  if (analysis.empty()) {
    analysis.notes = {"No policy ran both clean and perturbed."};
    return analysis;
  }
  analysis.tables = {perturbed_table(analysis.estimates, options.level)};
  const std::vector<DegradationCurve> papers = paper_curves(curves);
  Estimates of_curves;
  for (const DegradationCurve& curve : curves) add_curve(curve, of_curves);
  for (const DegradationCurve& curve : papers) add_curve(curve, of_curves);
  if (!curves.empty()) analysis.tables.push_back(curve_table(of_curves, !papers.empty()));
  analysis.plots = {{.plots = degradation_plots(curves, papers)}};
  analysis.estimates.insert(analysis.estimates.end(), of_curves.begin(), of_curves.end());
  return analysis;
}

namespace {

// A ladder and the success that counts as having passed a level of it.
struct Ladder {
  std::string_view word, title;
  double pass;
};
constexpr std::array<Ladder, 2> kLadders = {{
    {"level", "Levels", 0.5},   // of suites for policies
    {"stage", "Stages", 0.95},  // of suites for controllers, as suites/wbc_gates.yaml asks of pushes
}};

struct LevelName {
  int level = 0;
  std::string name;  // "walks_up"
  auto operator<=>(const LevelName&) const = default;
};

using CountsByLevel = std::map<int, SuccessByClip>;

// The headline; a robot that a commanded velocity leads has to follow it by half, so that standing is no walking.
bool passes(const EpisodeRow& row) {
  const auto metric = [&](const char* name) {
    const auto found = row.metrics.find(name);
    return found == row.metrics.end() ? 0.0 : found->second;
  };
  const double command = metric("command_forward");
  return headline_success(row) && (command <= 0.0 || metric("speed_forward") >= 0.5 * command);
}

// The tag of the row's perturbation or clip.
std::optional<LevelName> level_of(std::string_view word, std::string_view part, const EpisodeRow& row) {
  const double level = row.tags.number(row_tag(part, word));
  constexpr double kHighest = 999'999.0;  // kWholeTags
  if (!(level >= 0.0 && level <= kHighest) || level != std::floor(level)) return std::nullopt;
  return LevelName{static_cast<int>(level), row.tags.text(row_tag(part, std::string(word) + "_name"))};
}

// The level of its perturbation or of its clip, whichever is higher.
std::optional<LevelName> level_of_row(std::string_view word, const EpisodeRow& row) {
  const std::optional<LevelName> perturbed = level_of(word, kOfPerturbation, row), clip = level_of(word, kOfClip, row);
  if (perturbed && clip) return std::max(*perturbed, *clip);
  if (perturbed || (clip && row.perturbation == kClean)) return perturbed ? perturbed : clip;
  return row.perturbation == kClean ? std::optional(LevelName{0, std::string(kClean)}) : std::nullopt;
}

void add_level_name(const Ladder& ladder, const LevelName& found, std::map<int, std::string>& names) {
  const auto [known, is_new] = names.emplace(found.level, found.name);
  if (!is_new && known->second != found.name)
    throw InputError(
        fmt::format("two names of {} {}: '{}' and '{}'", ladder.word, found.level, known->second, found.name));
}

struct LadderCounts {
  std::map<int, std::string> names;
  std::map<PolicyKey, CountsByLevel> policies;
};

LadderCounts counts_of(const Ladder& ladder, const std::map<PolicyKey, PerturbedRows>& policies) {
  LadderCounts counts;
  for (const auto& [key, perturbed] : policies) {
    for (const auto& [perturbation, episodes] : perturbed) {
      for (const auto& [id, row] : episodes) {
        const std::optional<LevelName> found = level_of_row(ladder.word, *row);
        if (!found) continue;
        add_level_name(ladder, *found, counts.names);
        counts.policies[key][found->level].add(id, passes(*row) ? 1.0 : 0.0);
      }
    }
  }
  return counts;
}

// "level_3_walks_up".
std::string level_key(const Ladder& ladder, int level, const std::string& name) {
  return fmt::format("{}_{}{}{}", ladder.word, level, name.empty() ? "" : "_", name);
}

// Success at each level, 0 episodes where it was not run; its mean over those that were; the last one up to which each
// was passed, absent where not even the first was.
void add_levels(const Ladder& ladder, const std::map<int, std::string>& names, const CountsByLevel& counts,
                double level, EstimatesOf of) {
  std::optional<int> reached;
  bool passed = true;
  std::vector<double> rates;
  for (const auto& [number, name] : names) {
    const auto found = counts.find(number);
    const Rate rate = found == counts.end() ? Rate{} : make_rate(found->second, level);
    of.keys.of = level_key(ladder, number, name);
    of.rate("success", rate);
    passed = passed && rate.n > 0 && rate.rate >= ladder.pass;
    if (passed) reached = number;
    if (rate.n > 0) rates.push_back(rate.rate);
  }
  of.keys.of = ladder.word;
  const auto levels = static_cast<long>(names.size());
  of.add("mean", levels, mean_of(rates));
  if (reached) of.count("reached", levels, *reached);
}

std::string level_title(int level, const std::string& name) {
  std::string words = name;
  std::ranges::replace(words, '_', ' ');
  return words.empty() ? fmt::format("{}", level) : fmt::format("{} {}", level, words);
}

Pivot ladder_pivot(const Ladder& ladder, const std::map<int, std::string>& names, double level) {
  Pivot pivot{.title = std::string(ladder.title), .rows = policy_rows(), .columns = {}};
  for (const auto& [number, name] : names)
    pivot.columns.push_back(
        column(level_title(number, name), {.of = level_key(ladder, number, name), .name = "success"}, as_percent));
  const std::string word(ladder.word);
  pivot.columns.push_back(column("Mean [%]", {.of = word, .name = "mean"}, as_share));
  pivot.columns.push_back(column("Reached", {.of = word, .name = "reached"}, as_count, "none"));
  pivot.notes = {
      fmt::format("Success [%] at each {0}, from easy to hard, with {1:g} % Wilson intervals, by clip where a clip has "
                  "several episodes. Mean: over the {0}s, each counting the same. Reached: the last {0} up to which "
                  "success is {2:g} % or more at each.",
                  word, 100.0 * level, 100.0 * ladder.pass)};
  return pivot;
}

}  // namespace

Analysis level_analysis(const std::vector<EpisodeRow>& rows, double level) {
  Analysis analysis{.name = "levels", .title = "Levels", .level = level};
  const std::map<PolicyKey, PerturbedRows> policies = rows_of_policies(rows);
  for (const Ladder& ladder : kLadders) {
    const LadderCounts counts = counts_of(ladder, policies);
    if (counts.names.size() < 2) continue;
    Estimates estimates;
    EstimatesOf{{.of = std::string(ladder.word)}, estimates}.add("pass", {}, ladder.pass);
    for (const auto& [key, by_level] : counts.policies)
      add_levels(ladder, counts.names, by_level, level, estimates_of(key, estimates));
    analysis.tables.push_back(table_of(estimates, ladder_pivot(ladder, counts.names, level)));
    std::ranges::move(estimates, std::back_inserter(analysis.estimates));
  }
  return analysis;
}

}  // namespace duet
