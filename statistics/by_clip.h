// Shares over episodes that come in clips. Episodes of one clip resemble each other, in several engines, in both roles
// and in several draws: they are no independent episodes, and a test or an interval that takes them for such finds more
// than there is. No interval here is narrower than Wilson's or Newcombe's over as many episodes as there are clips,
// whatever the spread: eight successes in eight clips do not show a share of 100 %. Pure functions.
#pragma once

#include <span>

#include "duet/statistics/statistics.h"

namespace duet {

// The least number for a finding by itself; below it nobody is said to be ahead. [clips, or pairs, or episodes]
inline constexpr long kFewestClips = 30;

// Exact two-sided p-value of paired differences: how often so large a sum comes where the sum of each clip is as likely
// the other way round. `sums`: one a clip, successes of A less successes of B on the same episodes. It is
// mcnemar_exact where every clip has one pair; 1 for no clips.
double sign_flip_exact(std::span<const long> sums);

// Interval of the mean of `values`, each 0 to 1, with one id of a clip a value: Wilson's, of as many independent
// episodes as tell so much. Throws std::invalid_argument for no values, other values and another number of ids.
Interval wilson_by_clip(std::span<const double> values, std::span<const int> clips, double level = 0.95);
// Newcombe's paired interval, in the same way, of the mean of `a` less that of `b`, over the same episodes.
Interval newcombe_by_clip(std::span<const double> a, std::span<const double> b, std::span<const int> clips,
                          double level = 0.95);

}  // namespace duet
