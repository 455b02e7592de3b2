// Statistics of order: quantiles, rank correlation, times that are known only up to where watching ended. Pure
// functions.
#pragma once

#include <span>
#include <vector>

namespace duet {

// Linear between order statistics (the usual "type 7"). NaN for no values. p in [0, 1].
double quantile_of_sorted(std::span<const double> sorted, double p);
double quantile(std::vector<double> values, double p);

// The value below and above which the weights sum to the same, the mean of two where half ends between them. NaN for no
// weight. For ratios y / x weighted by |x| it is the slope through the origin with the least absolute deviations of y.
// Throws std::invalid_argument for unequal lengths and for negative weights.
double weighted_median(std::span<const double> values, std::span<const double> weights);

struct RankAgreement {
  long pairs = 0, concordant = 0, discordant = 0;  // of items; a pair tied in a or b is neither
  double tau_b = 0.0;                              // NaN where all of a or all of b are tied, or items are fewer than 2
};
// Kendall's tau-b. Values within 1e-9 of each other are tied. Throws std::invalid_argument for unequal lengths.
// Source: Kendall, "The treatment of ties in ranking problems", Biometrika 33, 1945.
RankAgreement kendall(std::span<const double> a, std::span<const double> b);

struct Lifetime {
  double time = 0.0;
  bool ended = false;  // false: censored, still going on at `time`
};
// First time at which the Kaplan-Meier estimate of those still going on is at most 1 - p; NaN where it never is. Where
// ends and censorings share a time, the ends come first. p in (0, 1). Source: Kaplan and Meier, JASA 53, 1958.
double kaplan_meier_quantile(std::vector<Lifetime> lifetimes, double p);

}  // namespace duet
