#include "duet/core/order_statistics.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

#include "duet/core/require.h"

namespace duet {
namespace {

constexpr double kUndefined = std::numeric_limits<double>::quiet_NaN();

int order(double x, double y) {
  constexpr double kTie = 1e-9;
  return std::abs(x - y) <= kTie ? 0 : x < y ? -1 : 1;
}

}  // namespace

double quantile_of_sorted(std::span<const double> sorted, double p) {
  require(p >= 0.0 && p <= 1.0, "quantile: expected p in [0, 1], found {}", p);
  if (sorted.empty()) return kUndefined;
  const double place = p * static_cast<double>(sorted.size() - 1);
  const auto below = static_cast<std::size_t>(place);
  const std::size_t above = std::min(below + 1, sorted.size() - 1);
  return sorted[below] + (place - static_cast<double>(below)) * (sorted[above] - sorted[below]);
}

double quantile(std::vector<double> values, double p) {
  require(p >= 0.0 && p <= 1.0, "quantile: expected p in [0, 1], found {}", p);
  if (values.empty()) return kUndefined;
  const double place = p * static_cast<double>(values.size() - 1);
  const auto below = values.begin() + static_cast<std::ptrdiff_t>(place);
  std::nth_element(values.begin(), below, values.end());
  const double above = below + 1 == values.end() ? *below : *std::min_element(below + 1, values.end());
  return *below + (place - std::floor(place)) * (above - *below);
}

double weighted_median(std::span<const double> values, std::span<const double> weights) {
  require(values.size() == weights.size(), "weighted median: expected one weight per value, found {} for {}",
          weights.size(), values.size());
  require(std::ranges::all_of(weights, [](double weight) { return weight >= 0.0; }),
          "weighted median: expected weights of at least 0");
  std::vector<std::size_t> order(values.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::erase_if(order, [&](std::size_t i) { return weights[i] == 0.0; });
  std::ranges::sort(order, {}, [&](std::size_t i) { return values[i]; });
  const double half = 0.5 * std::accumulate(weights.begin(), weights.end(), 0.0);
  double below = 0.0;
  for (std::size_t i = 0; i < order.size(); ++i) {
    below += weights[order[i]];
    if (below > half) return values[order[i]];
    if (below == half) return 0.5 * (values[order[i]] + values[order[i + 1]]);
  }
  return kUndefined;
}

RankAgreement kendall(std::span<const double> a, std::span<const double> b) {
  require(a.size() == b.size(), "Kendall's tau: expected as many values in both, found {} and {}", a.size(), b.size());
  RankAgreement result;
  long untied_a = 0;
  long untied_b = 0;
  for (std::size_t i = 0; i < a.size(); ++i) {
    for (std::size_t j = i + 1; j < a.size(); ++j) {
      const int in_a = order(a[i], a[j]);
      const int in_b = order(b[i], b[j]);
      ++result.pairs;
      untied_a += in_a != 0 ? 1 : 0;
      untied_b += in_b != 0 ? 1 : 0;
      result.concordant += in_a * in_b > 0 ? 1 : 0;
      result.discordant += in_a * in_b < 0 ? 1 : 0;
    }
  }
  const double scale = std::sqrt(static_cast<double>(untied_a) * static_cast<double>(untied_b));
  result.tau_b = scale > 0.0 ? static_cast<double>(result.concordant - result.discordant) / scale : kUndefined;
  return result;
}

double kaplan_meier_quantile(std::vector<Lifetime> lifetimes, double p) {
  require(p > 0.0 && p < 1.0, "Kaplan-Meier quantile: expected p in (0, 1), found {}", p);
  std::sort(lifetimes.begin(), lifetimes.end(), [](const Lifetime& x, const Lifetime& y) {
    return x.time != y.time ? x.time < y.time : x.ended && !y.ended;
  });
  constexpr double kRounding = 1e-12;
  double going_on = 1.0;
  auto at_risk = static_cast<double>(lifetimes.size());
  for (const Lifetime& lifetime : lifetimes) {
    // Ends that share a time: (n - 1) / n (n - 2) / (n - 1) ... = (n - d) / n.
    if (lifetime.ended) going_on *= (at_risk - 1.0) / at_risk;
    if (lifetime.ended && going_on <= 1.0 - p + kRounding) return lifetime.time;
    at_risk -= 1.0;
  }
  return kUndefined;
}

}  // namespace duet
