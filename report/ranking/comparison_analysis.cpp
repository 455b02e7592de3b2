// A comparison of two runs as a table and figures.
#include <fmt/format.h>

#include <algorithm>

#include "duet/report/ranking/comparison_parts.h"
#include "duet/report/ranking/resolution.h"
#include "duet/report/tables/cells.h"
#include "duet/statistics/by_clip.h"

namespace duet {
namespace {

std::string interval_text(const Interval& interval) {
  return fmt::format("[{:.1f}, {:.1f}]", 100.0 * interval.low, 100.0 * interval.high);
}

double share_of(long episodes, const Comparison& comparison) {
  return static_cast<double>(episodes) / static_cast<double>(comparison.pairs);
}

std::vector<std::string> comparison_cells(const Comparison& comparison, double margin) {
  return {comparison.group,
          count_cell(comparison.pairs),
          count_cell(comparison.clips),
          percent(share_of(comparison.both + comparison.only_a, comparison)),
          percent(share_of(comparison.both + comparison.only_b, comparison)),
          points(comparison.difference, comparison.interval),
          interval_text(comparison.cluster_interval),
          count_cell(comparison.only_a),
          count_cell(comparison.only_b),
          p_cell(comparison.p),
          p_cell(comparison.p_holm),
          p_cell(comparison.p_episodes),
          percent(comparison.minimum_detectable),
          std::string(to_string(verdict_of(comparison, margin)))};
}

long largest(const std::vector<Comparison>& comparisons, long Comparison::*field) {
  long value = 0;
  for (const Comparison& comparison : comparisons) value = std::max(value, comparison.*field);
  return value;
}

std::vector<std::string> comparison_notes(const std::vector<Comparison>& comparisons, double margin) {
  const double level = 100.0 * comparisons.front().level;
  std::vector<std::string> notes = {fmt::format(
      "Same episodes in both runs. A, B: success in %. A - B: points with Newcombe's paired {:g} % interval; by clip: "
      "bootstrap over clips, nowhere narrower than Newcombe's over so many clips. {} p (Holm): "
      "corrected for the {} comparisons here. MDE: the smallest "
      "difference, in points, that so many pairs with so much disagreement show in 80 % of runs. Verdict: of A; the "
      "same within the margin where the "
      "interval by clip lies within {:g} points, else better or worse where p (Holm) is at most {:.2g}.",
      level, kPairedTests, comparisons.size(), 100.0 * margin, 1.0 - comparisons.front().level)};
  std::string small;
  for (const Comparison& comparison : comparisons)
    if (comparison.clips < kFewestClips) small.append(small.empty() ? "" : "; ").append(comparison.group);
  if (!small.empty())
    notes.push_back(fmt::format("Warning: fewer than {} clips in {}. A difference there is no finding by itself.",
                                kFewestClips, small));
  const long only_a = largest(comparisons, &Comparison::unpaired_a);
  const long only_b = largest(comparisons, &Comparison::unpaired_b);
  if (only_a > 0 || only_b > 0)
    notes.push_back(fmt::format(
        "Warning: episodes without a partner are left out (in one group up to {} of A and {} of B).", only_a, only_b));
  for (const std::string& note : resolution_notes(comparisons, margin))
    notes.push_back(fmt::format("Caution: {}.", note));
  return notes;
}

}  // namespace

TitledTable comparison_table(const std::vector<Comparison>& comparisons, double margin) {
  TitledTable titled{.table = {.header = {"Comparison", "Pairs", "Clips", "A", "B", "A - B", "by clip", "only A",
                                          "only B", "p", "p (Holm)", "McNemar p", "MDE", "Verdict"}}};
  for (const Comparison& comparison : comparisons) titled.table.rows.push_back(comparison_cells(comparison, margin));
  return titled;
}

void add_comparison_figures(const Comparison& of, double margin, std::vector<Figure>& into) {
  const FiguresOf figures{{.engine = of.engine,
                           .controller = of.controller,
                           .policy = of.policy,
                           .perturbation = of.perturbation,
                           .task = of.task},
                          into};
  figures.add("success_a", of.pairs, share_of(of.both + of.only_a, of));
  into.back().k = of.both + of.only_a;
  figures.add("success_b", of.pairs, share_of(of.both + of.only_b, of));
  into.back().k = of.both + of.only_b;
  figures.add("difference", of.pairs, of.difference, of.interval);
  figures.add("difference_by_clip", of.pairs, of.difference, of.cluster_interval);
  for (const auto& [name, count] : {std::pair("both", of.both), std::pair("only_a", of.only_a),
                                    std::pair("only_b", of.only_b), std::pair("neither", of.neither)})
    figures.count(name, of.pairs, count);
  figures.add("p", of.pairs, of.p);
  figures.add("p_holm", of.pairs, of.p_holm);
  figures.add("p_episodes", of.pairs, of.p_episodes);
  figures.count("clips", of.pairs, of.clips);
  figures.add("minimum_detectable", of.pairs, of.minimum_detectable);
  figures.count("unpaired_a", {}, of.unpaired_a);
  figures.count("unpaired_b", {}, of.unpaired_b);
  figures.word("verdict", std::string(to_string(verdict_of(of, margin))));
}

Analysis comparison_analysis(const std::vector<Comparison>& comparisons, double margin) {
  Analysis analysis{.name = "comparison", .title = "Comparison"};
  if (comparisons.empty()) {
    analysis.notes = {"Nothing to compare."};
    return analysis;
  }
  analysis.level = comparisons.front().level;
  analysis.tables = {comparison_table(comparisons, margin)};
  analysis.tables.front().notes = comparison_notes(comparisons, margin);
  FiguresOf{{}, analysis.figures}.add("margin", {}, margin);
  for (const Comparison& comparison : comparisons) add_comparison_figures(comparison, margin, analysis.figures);
  return analysis;
}

}  // namespace duet
