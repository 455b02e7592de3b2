// Two methods, each trained several times, on the same episodes: what another training and other clips would give.
// Trainings and clips are both random effects, crossed: every training meets every episode.
#pragma once

#include <limits>
#include <span>
#include <vector>

#include "duet/statistics/statistics.h"

namespace duet {

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
