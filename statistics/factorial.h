// Contrasts of a full factorial of switches: from the outcome of every cell to what each switch does alone, to what
// switches do only together, and to each switch's fair share of the whole gap. A cell is a set of switches that are on,
// as bits: cell 0 has none, the last one has all. Pure functions.
#pragma once

#include <cstddef>
#include <span>
#include <string>
#include <vector>

#include "duet/statistics/statistics.h"

namespace duet {

inline constexpr int kMostSwitches = 4;

// A weight for each of the 2^switches cells; the weights sum to 0.
using Contrast = std::vector<double>;

// The last cell less the first.
Contrast gap_contrast(int switches);
// The part of the gap that no smaller set of these switches makes: of one switch its effect alone, of two what both
// together do beyond the sum of each alone (Harsanyi's dividend). Over all sets but the empty one they sum to the gap.
Contrast together_contrast(int switches, unsigned set);
// The effect of turning the switch back where all are on.
Contrast last_contrast(int switches, int which);
// The mean effect of the switch over all settings of the others, the main effect of a factorial experiment.
Contrast main_contrast(int switches, int which);
// Its Shapley value: its mean effect over all orders in which the switches may be turned. They sum to the gap.
Contrast shapley_contrast(int switches, int which);

// Names of the switches of a set, in their order: "law x armature".
std::string set_name(std::span<const std::string> switches, unsigned set, const char* between = " x ");

// An outcome of the same episodes in every cell, 0 to 1, and the clip of each.
struct FactorialOutcomes {
  int switches = 0;
  std::vector<std::vector<double>> cells;  // 2^switches, each with a value an episode
  std::vector<int> clips;                  // of each episode

  [[nodiscard]] long episodes() const { return static_cast<long>(clips.size()); }
  // The outcomes of those episodes alone whose place is true.
  [[nodiscard]] FactorialOutcomes only(const std::vector<bool>& chosen) const;
};

struct ContrastValue {
  double value = 0.0;
  Interval interval = kNoInterval;
};

// The mean of a contrast over episodes, with the interval of a bootstrap over clips: clips are drawn once for each
// number of clips and shared by all contrasts. It is nowhere narrower than newcombe_by_clip would have it of two events
// that come as often as the contrast is above and below 0, so that a contrast that is 0 in every episode of a few clips
// is not known to be 0. Throws std::invalid_argument for no episode and for sizes that do not fit.
ContrastValue contrast_value(const FactorialOutcomes& outcomes, const Contrast& contrast,
                             const IntervalOptions& options, ClusterBootstrap& bootstrap);

// One contrast over another, with the interval of the ratio over the same draws: a share of the gap.
ContrastValue contrast_share(const FactorialOutcomes& outcomes, const Contrast& part, const Contrast& whole,
                             const IntervalOptions& options, ClusterBootstrap& bootstrap);

// The smallest set of switches that, turned alone, gives all of the gap but the share `rest`; of several that with the
// least left. 0 where there is no gap.
unsigned sufficient_set(const FactorialOutcomes& outcomes, double rest);

}  // namespace duet
