#include "duet/report/ranking/resolution.h"

#include <fmt/format.h>

#include <cmath>

#include "duet/core/require.h"

namespace duet {
namespace {

constexpr long kMostNeeded = 100'000'000;

// The smallest n for which the falling `detectable` is at most the difference.
template <typename Detectable>
long smallest_number(double difference, const Detectable& detectable) {
  require(difference > 0.0 && difference < 1.0, "difference: expected a number in (0, 1), found {}", difference);
  long too_few = 0, enough = 1;
  while (enough < kMostNeeded && detectable(enough) > difference) {
    too_few = enough;
    enough *= 2;
  }
  while (enough - too_few > 1) {
    const long middle = too_few + (enough - too_few) / 2;
    (detectable(middle) > difference ? too_few : enough) = middle;
  }
  return enough;
}

double discordance_of(const Comparison& comparison) {
  return static_cast<double>(comparison.only_a + comparison.only_b) / static_cast<double>(comparison.pairs);
}

}  // namespace

PairVerdict verdict_of(const Comparison& comparison, double margin) {
  return verdict_of(comparison.difference, comparison.cluster_interval, comparison.p_holm, comparison.level, margin);
}

PairVerdict verdict_of(double difference, const Interval& interval, double p_holm, double level, double margin) {
  if (verdict_of(interval, margin) == PairVerdict::kSame) return PairVerdict::kSame;
  if (p_holm > 1.0 - level) return PairVerdict::kUndecided;
  return difference > 0.0 ? PairVerdict::kBetter : PairVerdict::kWorse;
}

long needed_pairs(double discordance, double difference, double alpha) {
  return smallest_number(difference,
                         [&](long n) { return minimum_detectable_difference_paired(discordance, n, alpha); });
}

long needed_episodes(double rate, double difference, double alpha) {
  return smallest_number(difference, [&](long n) { return minimum_detectable_difference(rate, n, alpha); });
}

std::vector<std::string> resolution_notes(const std::vector<Comparison>& comparisons, double margin) {
  std::vector<std::string> notes;
  for (const Comparison& comparison : comparisons) {
    if (comparison.minimum_detectable <= margin || verdict_of(comparison, margin) != PairVerdict::kUndecided) continue;
    notes.push_back(
        fmt::format("{}: {} pairs cannot resolve {:g} points; with so much disagreement about {} would (80 % of runs)",
                    comparison.group, comparison.pairs, 100.0 * margin,
                    needed_pairs(discordance_of(comparison), margin, 1.0 - comparison.level)));
  }
  return notes;
}

std::vector<std::string> resolution_notes(const std::vector<LeaderboardEntry>& entries, double margin) {
  std::vector<std::string> notes;
  for (const LeaderboardEntry& entry : entries) {
    if (entry.task != "all" || entry.arm == "null" || entry.n == 0) continue;
    const double alpha = 1.0 - entry.level;
    if (minimum_detectable_difference(entry.success, entry.n, alpha) <= margin) continue;
    notes.push_back(fmt::format(
        "{}/{}/{} {}: {} distinct episodes cannot resolve {:g} points to another arm; unpaired about {} would",
        entry.engine, entry.controller, entry.policy, entry.perturbation, entry.n, 100.0 * margin,
        needed_episodes(entry.success, margin, alpha)));
  }
  return notes;
}

}  // namespace duet
