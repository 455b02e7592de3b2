// Statistics of episodes that resemble one another: those of one clip, and those of one training.
#pragma once

#include <limits>
#include <span>
#include <vector>

#include "duet/statistics/statistics.h"

namespace duet {

// Shares over episodes that come in clips. Episodes of one clip resemble each other, in several engines, in both roles
// and in several draws: they are no independent episodes, and a test or an interval that takes them for such finds more
// than there is. No interval here is narrower than Wilson's or Newcombe's over as many episodes as there are clips,
// whatever the spread: eight successes in eight clips do not show a share of 100 %. Pure functions.

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

// Two methods, each trained several times, on the same episodes: what another training and other clips would give.
// Trainings and clips are both random effects, crossed: every training meets every episode.

// The trainings of one method: for each its success (1 or 0) in each episode.
using TrainingOutcomes = std::vector<std::vector<double>>;

// A difference between two methods; as it is made, nothing is known.
struct CrossedDifference {
  static constexpr double kUnknown = std::numeric_limits<double>::quiet_NaN();
  double difference = kUnknown;     // mean of A minus mean of B
  double error = kUnknown;          // its standard error
  double of_trainings = kUnknown;   // the part of error^2 that trainings make; NaN where error is 0
  double degrees = kUnknown;        // of freedom; infinite where error is 0
  Interval interval = kNoInterval;  // Student's
  double p = kUnknown;              // two-sided
};

// error^2 = s_A^2 / trainings of A + s_B^2 / trainings of B + s_clip^2 / clips: the spread of each method's trainings
// over all episodes, and that of the difference over clips (`clip` has one id per episode). Degrees of freedom are
// Satterthwaite's (1946). The effect of a training on a single clip is in each of the three: the test errs on the safe
// side. Throws std::invalid_argument: fewer than two trainings of a method or two clips, unequal lengths.
CrossedDifference crossed_difference(const TrainingOutcomes& a, const TrainingOutcomes& b, std::span<const int> clip,
                                     double level = 0.95);

// P(|T| > |t|) of Student's distribution. degrees > 0, not necessarily whole.
double student_two_sided(double t, double degrees);
// The t that |T| stays below with probability `level` in (0, 1).
double student_quantile(double level, double degrees);

}  // namespace duet
