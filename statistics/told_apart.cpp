#include "duet/statistics/told_apart.h"

#include <Eigen/Cholesky>
#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <map>
#include <set>

#include "duet/core/numbers.h"
#include "duet/core/require.h"

namespace duet {
namespace {

constexpr double kMostDeviations = 4.0;  // a z-score is bounded by this: one jump of a tracker decides nothing
constexpr int kResamples = 1000;

// Middle and deviation of every feature over the samples that have it.
struct Scale {
  Eigen::VectorXd middle, deviation;
};

Scale scale_of(std::span<const GroupedSample* const> samples) {
  const auto features = static_cast<Eigen::Index>(samples.front()->features.size());
  Scale scale{Eigen::VectorXd::Zero(features), Eigen::VectorXd::Ones(features)};
  for (Eigen::Index i = 0; i < features; ++i) {
    std::vector<double> values;
    for (const GroupedSample* sample : samples)
      if (std::isfinite(sample->features[i])) values.push_back(sample->features[i]);
    if (values.size() < 2) continue;
    scale.middle[i] = mean_of(values);
    scale.deviation[i] = std::max(sample_deviation(values), 1e-9);
  }
  return scale;
}

// 1, the z-scores, and their squares less 1.
Eigen::VectorXd row_of(const GroupedSample& sample, const Scale& scale) {
  const Eigen::Index n = scale.middle.size();
  Eigen::VectorXd row(1 + 2 * n);
  row[0] = 1.0;
  for (Eigen::Index i = 0; i < n; ++i) {
    const double value = sample.features[i];
    const double z = std::isfinite(value) ? (value - scale.middle[i]) / scale.deviation[i] : 0.0;
    row[1 + i] = std::clamp(z, -kMostDeviations, kMostDeviations);
    row[1 + n + i] = std::isfinite(value) ? std::pow(row[1 + i], 2) - 1.0 : 0.0;
  }
  return row;
}

struct Classifier {
  Scale scale;
  Eigen::VectorXd weights;

  [[nodiscard]] double score(const GroupedSample& sample) const { return row_of(sample, scale).dot(weights); }
};

// Newton's method on the penalised likelihood, which has one maximum.
Classifier fitted(std::span<const GroupedSample* const> samples) {
  constexpr int kMostSteps = 30;
  Classifier result{scale_of(samples), {}};
  const auto n = static_cast<Eigen::Index>(samples.size());
  Eigen::MatrixXd rows(n, 1 + 2 * result.scale.middle.size());
  Eigen::VectorXd target(n), weight(n);
  for (Eigen::Index i = 0; i < n; ++i) {
    rows.row(i) = row_of(*samples[i], result.scale).transpose();
    target[i] = samples[i]->first ? 1.0 : 0.0;
  }
  const double firsts = std::max(1.0, target.sum()), seconds = std::max(1.0, n - target.sum());
  for (Eigen::Index i = 0; i < n; ++i) weight[i] = 0.5 * n / (target[i] > 0.5 ? firsts : seconds);
  Eigen::VectorXd penalty = Eigen::VectorXd::Constant(rows.cols(), kWeightPenalty);
  penalty[0] = 1e-6;
  result.weights = Eigen::VectorXd::Zero(rows.cols());
  for (int step = 0; step < kMostSteps; ++step) {
    const Eigen::ArrayXd p = 1.0 / (1.0 + (-(rows * result.weights).array()).exp());
    const Eigen::VectorXd slope =
        rows.transpose() * (weight.array() * (target.array() - p)).matrix() - penalty.cwiseProduct(result.weights);
    Eigen::MatrixXd bend = rows.transpose() * (weight.array() * p * (1.0 - p)).matrix().asDiagonal() * rows;
    bend += penalty.asDiagonal();
    const Eigen::VectorXd change = bend.ldlt().solve(slope);
    result.weights += change;
    if (change.lpNorm<Eigen::Infinity>() < 1e-8) break;
  }
  return result;
}

// The fold of every cluster: those of a group are dealt out in a drawn order.
std::map<int, int> folds_of(std::span<const GroupedSample> samples, std::uint64_t seed) {
  std::map<int, int> fold;
  for (const bool first : {false, true}) {
    std::set<int> ids;
    for (const GroupedSample& sample : samples)
      if (sample.first == first) ids.insert(sample.cluster);
    require(static_cast<int>(ids.size()) >= kFewestToTell,
            "told apart: expected at least {} clips of either kind, found {}", kFewestToTell, ids.size());
    std::vector<int> order(ids.begin(), ids.end());
    Random random(seed, stream_key({"folds", first ? "first" : "second"}));
    for (std::size_t i = order.size(); i > 1; --i)
      std::swap(order[i - 1], order[static_cast<std::size_t>(random.below(static_cast<int>(i)))]);
    for (std::size_t i = 0; i < order.size(); ++i) fold[order[i]] = static_cast<int>(i) % kFolds;
  }
  return fold;
}

std::vector<double> held_out_scores(std::span<const GroupedSample> samples, const std::map<int, int>& fold) {
  std::vector<double> scores(samples.size());
  for (int held = 0; held < kFolds; ++held) {
    std::vector<const GroupedSample*> others;
    for (const GroupedSample& sample : samples)
      if (fold.at(sample.cluster) != held) others.push_back(&sample);
    const Classifier classifier = fitted(others);
    for (std::size_t i = 0; i < samples.size(); ++i)
      if (fold.at(samples[i].cluster) == held) scores[i] = classifier.score(samples[i]);
  }
  return scores;
}

// The area over pairs of one fold: scores of two classifiers are not held against each other.
double area_within_folds(const std::vector<double>& scores, const std::vector<bool>& first,
                         const std::vector<int>& fold) {
  double area = 0.0, pairs = 0.0;
  for (int held = 0; held < kFolds; ++held) {
    std::vector<double> own;
    std::vector<bool> group;
    for (std::size_t i = 0; i < scores.size(); ++i)
      if (fold[i] == held) {
        own.push_back(scores[i]);
        group.push_back(first[i]);
      }
    const auto firsts = static_cast<double>(std::ranges::count(group, true));
    const double here = firsts * (static_cast<double>(group.size()) - firsts);
    if (here > 0.0) area += here * area_under_curve(own, group);
    pairs += here;
  }
  return area / pairs;
}

// The interval of the area, over draws of as many clusters of either group as there are.
Interval resampled(std::span<const GroupedSample> samples, const std::vector<double>& scores,
                   const std::map<int, int>& fold, std::uint64_t seed) {
  std::array<std::map<int, std::vector<std::size_t>>, 2> of;
  for (std::size_t i = 0; i < samples.size(); ++i) of[samples[i].first ? 1 : 0][samples[i].cluster].push_back(i);
  std::array<std::vector<std::vector<std::size_t>>, 2> clusters;
  for (const int group : {0, 1})
    for (auto& [id, members] : of[group]) clusters[group].push_back(members);
  Random random(seed, stream_key({"resamples"}));
  std::vector<double> areas;
  for (int draw = 0; draw < kResamples; ++draw) {
    std::vector<double> drawn;
    std::vector<bool> first;
    std::vector<int> folds;
    for (const int group : {0, 1})
      for (std::size_t k = 0; k < clusters[group].size(); ++k)
        for (const std::size_t i : clusters[group][random.below(static_cast<int>(clusters[group].size()))]) {
          drawn.push_back(scores[i]);
          first.push_back(group == 1);
          folds.push_back(fold.at(samples[i].cluster));
        }
    const double area = area_within_folds(drawn, first, folds);
    if (std::isfinite(area)) areas.push_back(area);
  }
  std::ranges::sort(areas);
  return {quantile_of_sorted(areas, 0.025), quantile_of_sorted(areas, 0.975)};
}

}  // namespace

double FeatureWeight::size() const { return std::hypot(linear, square); }

double area_under_curve(std::span<const double> scores, const std::vector<bool>& first) {
  require(scores.size() == first.size(), "area under curve: expected as many groups as scores ({}), found {}",
          scores.size(), first.size());
  std::vector<std::size_t> order(scores.size());
  for (std::size_t i = 0; i < order.size(); ++i) order[i] = i;
  std::ranges::sort(order, {}, [&](std::size_t i) { return scores[i]; });
  double ranks = 0.0, firsts = 0.0;
  for (std::size_t begin = 0; begin < order.size();) {
    std::size_t end = begin;
    while (end < order.size() && scores[order[end]] == scores[order[begin]]) ++end;
    for (std::size_t i = begin; i < end; ++i)
      if (first[order[i]]) {
        ranks += 0.5 * static_cast<double>(begin + end + 1);
        firsts += 1.0;
      }
    begin = end;
  }
  const double pairs = firsts * (static_cast<double>(scores.size()) - firsts);
  return pairs > 0.0 ? (ranks - 0.5 * firsts * (firsts + 1.0)) / pairs : std::numeric_limits<double>::quiet_NaN();
}

ToldApart told_apart(std::span<const GroupedSample> samples, std::uint64_t seed) {
  for (const GroupedSample& sample : samples)
    require(!sample.features.empty() && sample.features.size() == samples.front().features.size(),
            "told apart: expected the features of the first sample ({}, at least one), found {}",
            samples.front().features.size(), sample.features.size());
  const std::map<int, int> fold = folds_of(samples, seed);
  const std::vector<double> scores = held_out_scores(samples, fold);
  std::vector<bool> first;
  std::vector<int> folds;
  std::vector<const GroupedSample*> all;
  std::set<int> firsts;
  for (const GroupedSample& sample : samples) {
    first.push_back(sample.first);
    folds.push_back(fold.at(sample.cluster));
    all.push_back(&sample);
    if (sample.first) firsts.insert(sample.cluster);
  }
  ToldApart result{.area = area_within_folds(scores, first, folds),
                   .interval = resampled(samples, scores, fold, seed),
                   .weights = {},
                   .first_clusters = static_cast<int>(firsts.size()),
                   .clusters = static_cast<int>(fold.size())};
  const Classifier classifier = fitted(all);
  const auto n = static_cast<int>(samples.front().features.size());
  for (int i = 0; i < n; ++i) result.weights.push_back({i, classifier.weights[1 + i], classifier.weights[1 + n + i]});
  std::ranges::stable_sort(result.weights, std::ranges::greater(), &FeatureWeight::size);
  return result;
}

}  // namespace duet
