// How well two groups of samples are told apart by a classifier: the distance between made and recorded people. Pure
// functions.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "duet/statistics/statistics.h"

namespace duet {

// One sample: its features (NaN where there is none), its group and its cluster; samples of a cluster (windows of a
// clip) are never on both sides of a division.
struct GroupedSample {
  std::vector<double> features;
  bool first = false;
  int cluster = 0;
};

// Area under the curve of sensitivity against specificity: the share of pairs, one of each group, in which that of the
// first has the higher score; ties count half. NaN where a group has none.
double area_under_curve(std::span<const double> scores, const std::vector<bool>& first);

// A feature's weight: of its z-score, and of that one's square (how far from the middle it is).
struct FeatureWeight {
  int feature = 0;
  double linear = 0.0, square = 0.0;

  [[nodiscard]] double size() const;
};

struct ToldApart {
  double area = 0.0;                     // held out, over pairs of one fold; 0.5: not told apart, 1: always
  Interval interval = kNoInterval;       // by resampling clusters, 95 %
  std::vector<FeatureWeight> weights;    // of the classifier of all samples, the largest first
  int first_clusters = 0, clusters = 0;  // of the first group, and of both
};

inline constexpr int kFewestToTell = 8;  // clusters of either group

// The classifier is a logistic regression on the features' z-scores and their squares, with a penalty on the weights
// (kWeightPenalty); both groups weigh the same, a missing feature has the middle's value. Each sample is judged by the
// classifier of the other folds, kFolds by cluster, drawn by `seed`. Throws std::invalid_argument for fewer than
// kFewestToTell clusters of a group, samples of different lengths or of none.
inline constexpr int kFolds = 5;
inline constexpr double kWeightPenalty = 10.0;  // times half the squared weights, beside the likelihood of all samples
ToldApart told_apart(std::span<const GroupedSample> samples, std::uint64_t seed);

}  // namespace duet
