#include "duet/statistics/factorial.h"

#include <algorithm>
#include <bit>
#include <cmath>

#include "duet/core/require.h"
#include "duet/statistics/clustered.h"

namespace duet {
namespace {

constexpr double kNoGap = 1e-12;

unsigned cells_of(int switches) {
  require(switches >= 1 && switches <= kMostSwitches, "factorial: expected 1 to {} switches, found {}", kMostSwitches,
          switches);
  return 1U << static_cast<unsigned>(switches);
}

unsigned bit(int which) { return 1U << static_cast<unsigned>(which); }

double factorial(int n) { return std::tgamma(n + 1.0); }

// A contrast per episode.
std::vector<double> per_episode(const FactorialOutcomes& outcomes, const Contrast& contrast) {
  require(outcomes.episodes() > 0, "factorial: expected at least one episode, found none");
  require(contrast.size() == outcomes.cells.size() && contrast.size() == cells_of(outcomes.switches),
          "factorial: expected {} cells of {} switches, found {} and {} weights", 1 << outcomes.switches,
          outcomes.switches, outcomes.cells.size(), contrast.size());
  std::vector<double> values(outcomes.clips.size(), 0.0);
  for (std::size_t cell = 0; cell < contrast.size(); ++cell) {
    require(outcomes.cells[cell].size() == values.size(), "factorial: expected {} episodes in cell {}, found {}",
            values.size(), cell, outcomes.cells[cell].size());
    for (std::size_t i = 0; i < values.size(); ++i) values[i] += contrast[cell] * outcomes.cells[cell][i];
  }
  return values;
}

// Newcombe's interval as of two events, one that the contrast is above 0 and one that it is below, as far as it is.
Interval least_interval(const std::vector<double>& values, std::span<const int> clips, double level) {
  double scale = 1.0;
  for (const double value : values) scale = std::max(scale, std::abs(value));
  std::vector<double> above(values.size()), below(values.size());
  for (std::size_t i = 0; i < values.size(); ++i) {
    above[i] = std::max(values[i], 0.0) / scale;
    below[i] = std::max(-values[i], 0.0) / scale;
  }
  const Interval interval = newcombe_by_clip(above, below, clips, level);
  return {scale * interval.low, scale * interval.high};
}

double mean_of_cell(const FactorialOutcomes& outcomes, unsigned cell) { return mean_of(outcomes.cells[cell]); }

}  // namespace

Contrast gap_contrast(int switches) {
  Contrast contrast(cells_of(switches), 0.0);
  contrast.front() = -1.0;
  contrast.back() = 1.0;
  return contrast;
}

Contrast together_contrast(int switches, unsigned set) {
  Contrast contrast(cells_of(switches), 0.0);
  require(set > 0 && set < contrast.size(), "factorial: expected a set of {} switches, found {}", switches, set);
  for (unsigned cell = 0; cell < contrast.size(); ++cell)
    if ((cell & ~set) == 0) contrast[cell] = std::popcount(set & ~cell) % 2 == 0 ? 1.0 : -1.0;
  return contrast;
}

Contrast last_contrast(int switches, int which) {
  Contrast contrast(cells_of(switches), 0.0);
  contrast.back() = 1.0;
  contrast[(contrast.size() - 1) & ~bit(which)] = -1.0;
  return contrast;
}

Contrast main_contrast(int switches, int which) {
  const unsigned cells = cells_of(switches);
  Contrast contrast(cells);
  for (unsigned cell = 0; cell < cells; ++cell) contrast[cell] = ((cell & bit(which)) != 0 ? 2.0 : -2.0) / cells;
  return contrast;
}

Contrast shapley_contrast(int switches, int which) {
  const unsigned cells = cells_of(switches);
  Contrast contrast(cells);
  for (unsigned cell = 0; cell < cells; ++cell) {
    const int others = std::popcount(cell & ~bit(which));  // that were turned before
    const double weight = factorial(others) * factorial(switches - others - 1) / factorial(switches);
    contrast[cell] = (cell & bit(which)) != 0 ? weight : -weight;
  }
  return contrast;
}

std::string set_name(std::span<const std::string> switches, unsigned set, const char* between) {
  std::string name;
  for (std::size_t i = 0; i < switches.size(); ++i)
    if ((set & bit(static_cast<int>(i))) != 0) name += (name.empty() ? "" : between) + switches[i];
  return name;
}

FactorialOutcomes FactorialOutcomes::only(const std::vector<bool>& chosen) const {
  FactorialOutcomes part{.switches = switches, .cells = std::vector<std::vector<double>>(cells.size()), .clips = {}};
  for (std::size_t i = 0; i < clips.size(); ++i) {
    if (!chosen[i]) continue;
    part.clips.push_back(clips[i]);
    for (std::size_t cell = 0; cell < cells.size(); ++cell) part.cells[cell].push_back(cells[cell][i]);
  }
  return part;
}

ContrastValue contrast_value(const FactorialOutcomes& outcomes, const Contrast& contrast,
                             const IntervalOptions& options, ClusterBootstrap& bootstrap) {
  const std::vector<double> values = per_episode(outcomes, contrast);
  const Interval drawn = bootstrap.mean(values, outcomes.clips, options.level);
  const Interval least = least_interval(values, outcomes.clips, options.level);
  return {mean_of(values), {std::min(drawn.low, least.low), std::max(drawn.high, least.high)}};
}

ContrastValue contrast_share(const FactorialOutcomes& outcomes, const Contrast& part, const Contrast& whole,
                             const IntervalOptions& options, ClusterBootstrap& bootstrap) {
  const std::vector<double> above = per_episode(outcomes, part), below = per_episode(outcomes, whole);
  const auto ratio = [&](std::span<const double> weights) {
    double up = 0.0, down = 0.0;
    for (std::size_t i = 0; i < weights.size(); ++i) {
      up += weights[i] * above[i];
      down += weights[i] * below[i];
    }
    return std::abs(down) > kNoGap ? up / down : std::numeric_limits<double>::quiet_NaN();
  };
  const std::vector<double> once(above.size(), 1.0);
  const double share = ratio(once);
  if (std::isnan(share)) return {share, kNoInterval};
  return {share, bootstrap.weighted(outcomes.clips, ratio, options.level)};
}

unsigned sufficient_set(const FactorialOutcomes& outcomes, double rest) {
  const unsigned all = cells_of(outcomes.switches) - 1;
  const double to = mean_of_cell(outcomes, all), gap = std::abs(to - mean_of_cell(outcomes, 0));
  if (gap < kNoGap) return 0;
  unsigned best = all;
  double least = 0.0;
  for (unsigned set = 1; set < all; ++set) {
    const double left = std::abs(to - mean_of_cell(outcomes, set));
    if (left > rest * gap + kNoGap) continue;
    const int size = std::popcount(set), so_far = std::popcount(best);
    if (size > so_far || (size == so_far && left >= least)) continue;
    best = set;
    least = left;
  }
  return best;
}

}  // namespace duet
