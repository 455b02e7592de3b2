#include "duet/statistics/rater_agreement.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>

#include "duet/core/require.h"

namespace duet {
namespace {

constexpr double kUndefined = std::numeric_limits<double>::quiet_NaN();

// Checks the answers; returns the number of categories: one more than the largest.
std::size_t checked_categories(const std::vector<std::span<const int>>& raters, std::span<const double> weights) {
  require(raters.size() >= 2, "kappa: expected two raters or more, found {}", raters.size());
  const std::size_t subjects = raters.front().size();
  int largest = -1;
  for (const std::span<const int> rater : raters) {
    require(rater.size() == subjects, "kappa: expected {} categories of each rater, found {}", subjects, rater.size());
    for (const int category : rater) {
      require(category >= 0, "kappa: expected categories from 0, found {}", category);
      largest = std::max(largest, category);
    }
  }
  require(weights.empty() || weights.size() == subjects, "kappa: expected a weight for each of {} subjects, found {}",
          subjects, weights.size());
  return static_cast<std::size_t>(largest) + 1;
}

double weight_of(std::span<const double> weights, std::size_t subject) {
  return weights.empty() ? 1.0 : weights[subject];
}

double beyond_chance(double agreed, double chance) {
  constexpr double kCertain = 1.0 - 1e-12;  // one category alone
  return chance < kCertain ? (agreed - chance) / (1.0 - chance) : kUndefined;
}

// Weighted shares of the categories in one rater's list.
std::vector<double> shares_of(std::span<const int> rater, std::span<const double> weights, std::size_t categories) {
  std::vector<double> shares(categories, 0.0);
  double all = 0.0;
  for (std::size_t i = 0; i < rater.size(); ++i) {
    shares[static_cast<std::size_t>(rater[i])] += weight_of(weights, i);
    all += weight_of(weights, i);
  }
  for (double& share : shares) share /= all;
  return shares;
}

// Share of the pairs of raters that agree on a subject, on average.
double share_agreed(const std::vector<std::span<const int>>& raters, std::span<const double> weights) {
  double agreed = 0.0, all = 0.0;
  for (std::size_t i = 0; i < raters.front().size(); ++i)
    for (std::size_t a = 0; a < raters.size(); ++a)
      for (std::size_t b = 0; b < a; ++b) {
        agreed += raters[a][i] == raters[b][i] ? weight_of(weights, i) : 0.0;
        all += weight_of(weights, i);
      }
  return all > 0.0 ? agreed / all : kUndefined;
}

std::vector<std::span<const int>> spans_of(const std::vector<std::vector<int>>& raters) {
  return {raters.begin(), raters.end()};
}

}  // namespace

double fleiss_kappa(const std::vector<std::vector<int>>& raters, std::span<const double> weights) {
  const std::vector<std::span<const int>> spans = spans_of(raters);
  const std::size_t categories = checked_categories(spans, weights);
  const double agreed = share_agreed(spans, weights);
  if (!(agreed >= 0.0)) return kUndefined;
  std::vector<double> together(categories, 0.0);
  for (const std::span<const int> rater : spans) {
    const std::vector<double> own = shares_of(rater, weights, categories);
    for (std::size_t k = 0; k < categories; ++k) together[k] += own[k] / static_cast<double>(raters.size());
  }
  double chance = 0.0;
  for (const double share : together) chance += share * share;
  return beyond_chance(agreed, chance);
}

double cohen_kappa(std::span<const int> a, std::span<const int> b, std::span<const double> weights) {
  const std::size_t categories = checked_categories({a, b}, weights);
  const double agreed = share_agreed({a, b}, weights);
  if (!(agreed >= 0.0)) return kUndefined;
  const std::vector<double> of_a = shares_of(a, weights, categories), of_b = shares_of(b, weights, categories);
  double chance = 0.0;
  for (std::size_t k = 0; k < categories; ++k) chance += of_a[k] * of_b[k];
  return beyond_chance(agreed, chance);
}

Kappa kappa_by_cluster(const std::vector<std::vector<int>>& raters, std::span<const int> cluster,
                       ClusterBootstrap& bootstrap, double level) {
  const auto kappa = [&](std::span<const double> weights) {
    return raters.size() == 2 ? cohen_kappa(raters[0], raters[1], weights) : fleiss_kappa(raters, weights);
  };
  Kappa found;
  found.value = kappa({});  // checks the lists
  found.n = static_cast<long>(raters.front().size());
  found.agreed = share_agreed(spans_of(raters), {});
  const bool one_cluster = std::ranges::adjacent_find(cluster, std::not_equal_to()) == cluster.end();
  if (!std::isnan(found.value) && !one_cluster) found.interval = bootstrap.weighted(cluster, kappa, level);
  return found;
}

}  // namespace duet
