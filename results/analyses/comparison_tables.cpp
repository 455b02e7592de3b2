// A comparison of two runs as Markdown and JSON.
#include <fmt/format.h>

#include "duet/results/analyses/comparison_parts.h"
#include "duet/results/analyses/leaderboard_rows.h"
#include "duet/results/analyses/text_table.h"
#include "duet/results/rows/json_fields.h"
#include "duet/results/statistics/resolution.h"

namespace duet {
namespace {

std::string p_value(double p) { return p < 0.001 ? "<0.001" : fmt::format("{:.3f}", p); }

std::string interval_text(const Interval& interval) {
  return fmt::format("[{:.1f}, {:.1f}]", 100.0 * interval.low, 100.0 * interval.high);
}

std::vector<std::string> cells_of(const Comparison& comparison, double margin) {
  const double pairs = static_cast<double>(comparison.pairs);
  return {comparison.group,
          fmt::format("{}", comparison.pairs),
          percent(static_cast<double>(comparison.both + comparison.only_a) / pairs),
          percent(static_cast<double>(comparison.both + comparison.only_b) / pairs),
          points(comparison.difference, comparison.interval),
          interval_text(comparison.cluster_interval),
          fmt::format("{}", comparison.only_a),
          fmt::format("{}", comparison.only_b),
          p_value(comparison.p),
          p_value(comparison.p_holm),
          fmt::format("{:.1f}", 100.0 * comparison.minimum_detectable),
          std::string(to_string(verdict_of(comparison, margin)))};
}

long largest(const std::vector<Comparison>& comparisons, long Comparison::*field) {
  long value = 0;
  for (const Comparison& comparison : comparisons) value = std::max(value, comparison.*field);
  return value;
}

std::string notes(const std::vector<Comparison>& comparisons, double margin) {
  const double level = 100.0 * comparisons.front().level;
  std::string text = fmt::format(
      "Same episodes in both runs. A, B: success in %. A - B: points with Newcombe's paired {:g} % interval; by clip: "
      "bootstrap over clips. p: exact McNemar, p (Holm): corrected for the {} comparisons here. MDE: the smallest "
      "difference, in points, that so many pairs with so much disagreement show in 80 % of runs. Verdict: of A; the "
      "same within the margin where the paired "
      "interval lies within {:g} points, else better or worse where p (Holm) is at most {:.2g}.\n",
      level, comparisons.size(), 100.0 * margin, 1.0 - comparisons.front().level);
  std::string small;
  for (const Comparison& comparison : comparisons) {
    if (comparison.pairs < 30) small.append(small.empty() ? "" : "; ").append(comparison.group);
  }
  if (!small.empty()) {
    text += fmt::format("Warning: fewer than 30 pairs in {}. A difference there is no finding by itself.\n", small);
  }
  const long only_a = largest(comparisons, &Comparison::unpaired_a);
  const long only_b = largest(comparisons, &Comparison::unpaired_b);
  if (only_a > 0 || only_b > 0) {
    text += fmt::format("Warning: episodes without a partner are left out (in one group up to {} of A and {} of B).\n",
                        only_a, only_b);
  }
  return text;
}

}  // namespace

TextTable comparison_table(const std::vector<Comparison>& comparisons, double margin) {
  TextTable table;
  table.header = {"Comparison", "Pairs",  "A", "B",        "A - B", "by clip",
                  "only A",     "only B", "p", "p (Holm)", "MDE",   "Verdict"};
  for (const Comparison& comparison : comparisons) table.rows.push_back(cells_of(comparison, margin));
  return table;
}

std::string comparison_markdown(const std::vector<Comparison>& comparisons) {
  return comparison_markdown(comparisons, kFivePoints);
}

std::string comparison_markdown(const std::vector<Comparison>& comparisons, double margin) {
  if (comparisons.empty()) return "Nothing to compare.\n";
  std::string text = markdown_table(comparison_table(comparisons, margin)) + "\n" + notes(comparisons, margin);
  for (const std::string& note : resolution_notes(comparisons, margin)) text += fmt::format("Caution: {}.\n", note);
  return text;
}

nlohmann::json comparison_json(const std::vector<Comparison>& comparisons) {
  return comparison_json(comparisons, kFivePoints);
}

nlohmann::json comparison_json(const std::vector<Comparison>& comparisons, double margin) {
  nlohmann::json list = nlohmann::json::array();
  const auto interval = [](const Interval& limits) {
    return nlohmann::json::array({number_or_null(limits.low), number_or_null(limits.high)});
  };
  for (const Comparison& comparison : comparisons) {
    list.push_back({{"group", comparison.group},
                    {"pairs", comparison.pairs},
                    {"both", comparison.both},
                    {"only_a", comparison.only_a},
                    {"only_b", comparison.only_b},
                    {"neither", comparison.neither},
                    {"difference", number_or_null(comparison.difference)},
                    {"interval", interval(comparison.interval)},
                    {"cluster_interval", interval(comparison.cluster_interval)},
                    {"level", comparison.level},
                    {"p", number_or_null(comparison.p)},
                    {"p_holm", number_or_null(comparison.p_holm)},
                    {"minimum_detectable", number_or_null(comparison.minimum_detectable)},
                    {"unpaired_a", comparison.unpaired_a},
                    {"unpaired_b", comparison.unpaired_b},
                    {"verdict", std::string(to_string(verdict_of(comparison, margin)))}});
  }
  return {{"schema", "duet.comparison/1"}, {"margin", margin}, {"comparisons", std::move(list)}};
}

}  // namespace duet
