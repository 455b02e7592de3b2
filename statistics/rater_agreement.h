// How far raters agree beyond chance, on categories without an order (yes, no, unsure). Pure functions; the randomness
// of an interval is a seed argument.
#pragma once

#include <span>
#include <vector>

#include "duet/statistics/statistics.h"

namespace duet {

// Fleiss' kappa of R raters, each with one category (0, 1, ...) for each of the N subjects. NaN where it is not
// defined: no subject, or one category alone. `weights`: how often each subject counts, N entries; empty: once. Throws
// std::invalid_argument for fewer than two raters, lists of different lengths and a category below 0.
// Source: Fleiss, "Measuring nominal scale agreement among many raters", Psychological Bulletin 76 (1971).
double fleiss_kappa(const std::vector<std::vector<int>>& raters, std::span<const double> weights = {});

// Cohen's kappa of two raters, whose chance agreement has the shares of each; as above.
// Source: Cohen, "A coefficient of agreement for nominal scales", Educational and Psychological Measurement 20 (1960).
double cohen_kappa(std::span<const int> a, std::span<const int> b, std::span<const double> weights = {});

// A kappa with its percentile interval by resampling clusters (clips). Resamples in which it is not defined are left
// out. One cluster alone tells nothing of others: no interval.
struct Kappa {
  long n = 0;           // subjects
  double agreed = 0.0;  // share of the pairs of raters that agree; NaN of no subject
  double value = 0.0;   // NaN: not defined
  Interval interval = kNoInterval;
};
// `cluster`: of each subject. Two raters: Cohen's, more: Fleiss'.
Kappa kappa_by_cluster(const std::vector<std::vector<int>>& raters, std::span<const int> cluster,
                       ClusterBootstrap& bootstrap, double level = 0.95);

}  // namespace duet
