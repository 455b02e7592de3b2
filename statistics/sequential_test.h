// A test of a mean difference that may be looked at after every round and stopped at any of them: its error holds
// whatever the moment at which somebody stops. A round has one observation of each stratum that is there; observations
// of different strata, and of different rounds, must be independent. Pure functions, no randomness.
//
// How: betting. For a supposed mean m the observations y = (1 + x) / 2 in [0, 1] multiply a capital of 1 by
// 1 - l + l y / y_m for each of a few fixed stakes l; the capital is the mean over stakes. Where m is the mean over
// strata, a round multiplies it by at most 1 in expectation (the stake is the same in all strata, and a product of
// means is at most the power of their mean), so that the capital ever reaches 1/alpha with probability alpha at most
// (Ville). Source: Waudby-Smith and Ramdas, "Estimating means of bounded random variables by betting", JRSS B 86, 2024;
// for comparing policies: arXiv 2603.13616.
#pragma once

#include <map>
#include <span>
#include <string_view>

#include "duet/statistics/statistics.h"

namespace duet {

class SequentialTest {
 public:
  // The differences of one round, A minus B, one per stratum, each in [-1, 1]. Throws std::invalid_argument outside.
  void add_round(std::span<const double> differences);

  [[nodiscard]] long observations() const { return observations_; }
  [[nodiscard]] double difference() const;  // mean so far; NaN before the first
  // The capital against the mean m: that it is larger (`above`), or smaller. As a logarithm. m in (-1, 1).
  [[nodiscard]] double log_capital(double m, bool above) const;
  // Evidence against "no difference": the mean of both capitals at m = 0. Large: a difference; 1 before the first
  // round.
  [[nodiscard]] double e_value() const;
  // min(1, 1 / the largest e-value of all rounds): valid whenever it is read.
  [[nodiscard]] double anytime_p() const;
  // Means against which neither capital has reached 2 / alpha. It holds the true one after all rounds at once with
  // probability 1 - alpha. [-1, 1] before the first round.
  [[nodiscard]] Interval interval(double alpha) const;

 private:
  std::map<double, long> counts_;  // how often a difference was seen
  long observations_ = 0;
  double sum_ = 0.0, largest_e_ = 1.0;
};

// The verdict on A against B.
enum class SequentialDecision { kUndecided, kBetter, kWorse, kSame };
std::string_view to_string(SequentialDecision verdict);  // "undecided", "better", "worse", "same within the margin"

// `interval` of A minus B: the same where it lies inside (-margin, margin), even where it leaves out 0; else better or
// worse where it leaves out 0. margin in (0, 1); throws std::invalid_argument.
SequentialDecision verdict_of(const Interval& interval, double margin);

}  // namespace duet
