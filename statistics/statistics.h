// The statistics of leaderboards: intervals, paired tests, the smallest difference that a run can see. Pure functions;
// any randomness is a seed argument.
#pragma once

#include <cstdint>
#include <functional>
#include <limits>
#include <map>
#include <span>
#include <string>
#include <vector>

namespace duet {

struct Interval {
  double low = 0.0, high = 0.0;
};
inline constexpr Interval kNoInterval = {std::numeric_limits<double>::quiet_NaN(),
                                         std::numeric_limits<double>::quiet_NaN()};

double mean_of(const std::vector<double>& values);           // NaN of none
double sample_deviation(const std::vector<double>& values);  // NaN of fewer than two

// Options of the intervals of an analysis; the latter two are of those that are bootstrapped.
struct IntervalOptions {
  double level = 0.95;
  int resamples = 10000;
  std::uint64_t seed = 1;
};

// Wilson score interval of k successes in n. n = 0: [0, 1]. Throws std::invalid_argument for k not in [0, n].
Interval wilson(long k, long n, double level = 0.95);
Interval wilson_of(double k, double n, double level = 0.95);  // of numbers that need not be whole

// Newcombe's interval (method 10, paired) of p_a - p_b from the paired table: both, only a, only b, neither.
Interval newcombe_paired(long both, long only_a, long only_b, long neither, double level = 0.95);
struct PairCounts {
  double both = 0.0, only_a = 0.0, only_b = 0.0, neither = 0.0;
};
Interval newcombe_of(const PairCounts& pairs, double level = 0.95);  // of numbers that need not be whole

// Newcombe's interval (method 10, independent) of p_a - p_b, two shares whose own intervals are known.
Interval newcombe_of_shares(double p_a, const Interval& a, double p_b, const Interval& b);

// Exact two-sided McNemar p-value from the discordant counts.
double mcnemar_exact(long only_a, long only_b);

// Fisher's exact one-sided p-value: of so many or more of the k_a + k_b among the first n_a, had they fallen on all
// n_a + n_b alike. 1 where n_a or n_b is 0. Throws std::invalid_argument unless 0 <= k <= n of both.
double fisher_exact_greater(long k_a, long n_a, long k_b, long n_b);

// Percentile interval of the mean by resampling clusters with replacement. `cluster` has one id per value.
Interval cluster_bootstrap(std::span<const double> values, std::span<const int> cluster, int resamples,
                           std::uint64_t seed, double level = 0.95);

// The same for many sets of values: clusters are drawn once for each number of clusters, so that sets with the same
// clusters share their draws. Equal to cluster_bootstrap with the same seed.
class ClusterBootstrap {
 public:
  ClusterBootstrap(int resamples, std::uint64_t seed);  // throws std::invalid_argument for no resamples
  Interval mean(std::span<const double> values, std::span<const int> cluster, double level = 0.95);
  // The interval of the sum of `above` over the sum of `below`, for instance a slope through the origin. Throws
  // std::invalid_argument where a value of `below` is not above 0.
  Interval ratio(std::span<const double> above, std::span<const double> below, std::span<const int> cluster,
                 double level = 0.95);
  // The interval of the weighted median. Throws std::invalid_argument where a weight is not above 0.
  Interval weighted_median(std::span<const double> values, std::span<const double> weights,
                           std::span<const int> cluster, double level = 0.95);
  // The interval of any other statistic of the values, given how often each is drawn (its weight, one per value of
  // `cluster`). Resamples in which it is NaN are left out; kNoInterval where that is all of them.
  Interval weighted(std::span<const int> cluster, const std::function<double(std::span<const double>)>& statistic,
                    double level = 0.95);

 private:
  const std::vector<int>& draws(int clusters);
  // Percentile interval of statistic(std::span<const int>) over the resamples: the clusters drawn, by number.
  template <typename Statistic>
  Interval percentiles(int clusters, double level, const Statistic& statistic);

  int resamples_;
  std::uint64_t seed_;
  std::map<int, std::vector<int>> draws_;  // number of clusters -> (resamples, clusters)
};

// Holm's step-down adjustment, in the order given.
std::vector<double> holm(std::span<const double> p_values);

// Smallest difference of two proportions that n (pairs, or episodes per arm) shows with the power given.
double minimum_detectable_difference(double p, long n, double alpha = 0.05, double power = 0.8);
// The same for a paired design with the discordance rate given.
double minimum_detectable_difference_paired(double discordance, long n, double alpha = 0.05, double power = 0.8);

// Quantile of the standard normal distribution. p in (0, 1).
double normal_quantile(double p);

}  // namespace duet
