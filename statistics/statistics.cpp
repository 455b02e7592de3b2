#include "duet/statistics/statistics.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <map>
#include <numeric>

#include "duet/core/numbers.h"
#include "duet/core/require.h"

namespace duet {
namespace {

void require_level(double level) {
  require(level > 0.0 && level < 1.0, "level: expected a number in (0, 1), found {}", level);
}

double two_sided_z(double level) {
  require_level(level);
  return normal_quantile(0.5 + 0.5 * level);
}

double polynomial(const std::array<double, 8>& c, double x) {
  double y = 0.0;
  for (int i = 7; i >= 0; --i) y = y * x + c[i];
  return y;
}

// Newcombe 1998 uses the correlation of the paired table with a correction for continuity that moves it towards 0 from
// above only.
double paired_correlation(double a, double b, double c, double d) {
  const double product = (a + b) * (c + d) * (a + c) * (b + d);
  if (product <= 0.0) return 0.0;
  double determinant = a * d - b * c;
  if (determinant > 0.0) determinant = std::max(determinant - (a + b + c + d) / 2.0, 0.0);
  return determinant / std::sqrt(product);
}

double square_and_add(double left, double right, double correlation) {
  return std::sqrt(std::max(left * left - 2.0 * correlation * left * right + right * right, 0.0));
}

// Clusters in the order of first appearance, so that the numbers that name clusters do not matter.
struct ClusterPlaces {
  std::vector<std::size_t> of;  // value -> cluster
  std::size_t clusters = 0;
};
ClusterPlaces places_of(std::span<const int> ids) {
  ClusterPlaces places;
  std::map<int, std::size_t> known;
  for (const int id : ids) places.of.push_back(known.try_emplace(id, known.size()).first->second);
  places.clusters = known.size();
  return places;
}

void require_samples(std::span<const double> values, std::span<const double> positive, std::span<const int> cluster,
                     const char* what) {
  require(!values.empty(), "bootstrap: expected at least one value, found none");
  require(values.size() == cluster.size(), "bootstrap: expected one cluster per value, found {} for {}", cluster.size(),
          values.size());
  require(positive.size() == values.size(), "bootstrap: expected one {} per value, found {} for {}", what,
          positive.size(), values.size());
  require(std::ranges::all_of(positive, [](double value) { return value > 0.0; }), "bootstrap: expected {}s above 0",
          what);
}

struct PowerQuantiles {
  double alpha, beta;
};

PowerQuantiles power_quantiles(long n, double alpha, double power) {
  require(n > 0, "n: expected at least 1, found {}", n);
  require(alpha > 0.0 && alpha < 1.0, "alpha: expected a number in (0, 1), found {}", alpha);
  require(power > 0.0 && power < 1.0, "power: expected a number in (0, 1), found {}", power);
  return {.alpha = normal_quantile(1.0 - alpha / 2.0), .beta = normal_quantile(power)};
}

// The difference at which every discordant pair goes the same way: sqrt(n d) = z_alpha + z_beta sqrt(1 - d). No smaller
// difference can be seen with n pairs, however few pairs disagree.
double one_sided_difference(double n, const PowerQuantiles& z) {
  double low = 0.0;
  double high = 1.0;
  for (int i = 0; i < 60; ++i) {
    const double d = 0.5 * (low + high);
    (std::sqrt(n * d) < z.alpha + z.beta * std::sqrt(1.0 - d) ? low : high) = d;
  }
  return high;
}

}  // namespace

double mean_of(const std::vector<double>& values) {
  double sum = 0.0;
  for (const double value : values) sum += value;
  return values.empty() ? std::numeric_limits<double>::quiet_NaN() : sum / static_cast<double>(values.size());
}

double sample_deviation(const std::vector<double>& values) {
  if (values.size() < 2) return std::numeric_limits<double>::quiet_NaN();
  const double mean = mean_of(values);
  double sum = 0.0;
  for (const double value : values) sum += (value - mean) * (value - mean);
  return std::sqrt(sum / static_cast<double>(values.size() - 1));
}

Interval wilson_of(double k, double n, double level) {
  const double z = two_sided_z(level);
  if (n == 0.0) return {.low = 0.0, .high = 1.0};
  const double p = k / n;
  const double scale = 1.0 / (1.0 + z * z / n);
  const double centre = scale * (p + z * z / (2.0 * n));
  const double half = scale * z * std::sqrt(p * (1.0 - p) / n + z * z / (4.0 * n * n));
  return {.low = k == 0.0 ? 0.0 : std::max(centre - half, 0.0), .high = k == n ? 1.0 : std::min(centre + half, 1.0)};
}

Interval wilson(long k, long n, double level) {
  require(n >= 0 && k >= 0 && k <= n, "Wilson interval: expected 0 <= k <= n, found k = {}, n = {}", k, n);
  return wilson_of(static_cast<double>(k), static_cast<double>(n), level);
}

Interval newcombe_of(const PairCounts& pairs, double level) {
  const auto& [both, only_a, only_b, neither] = pairs;
  const double size = both + only_a + only_b + neither;
  require_level(level);
  if (size == 0.0) return {.low = -1.0, .high = 1.0};
  const double p_a = (both + only_a) / size;
  const double p_b = (both + only_b) / size;
  const Interval a = wilson_of(both + only_a, size, level);
  const Interval b = wilson_of(both + only_b, size, level);
  const double correlation = paired_correlation(both, only_a, only_b, neither);
  const double difference = (only_a - only_b) / size;
  return {.low = difference - square_and_add(p_a - a.low, b.high - p_b, correlation),
          .high = difference + square_and_add(a.high - p_a, p_b - b.low, correlation)};
}

Interval newcombe_paired(long both, long only_a, long only_b, long neither, double level) {
  require(both >= 0 && only_a >= 0 && only_b >= 0 && neither >= 0,
          "paired table: expected counts of at least 0, found {}, {}, {}, {}", both, only_a, only_b, neither);
  return newcombe_of({static_cast<double>(both), static_cast<double>(only_a), static_cast<double>(only_b),
                      static_cast<double>(neither)},
                     level);
}

Interval newcombe_of_shares(double p_a, const Interval& a, double p_b, const Interval& b) {
  return {.low = p_a - p_b - square_and_add(p_a - a.low, b.high - p_b, 0.0),
          .high = p_a - p_b + square_and_add(a.high - p_a, p_b - b.low, 0.0)};
}

double mcnemar_exact(long only_a, long only_b) {
  require(only_a >= 0 && only_b >= 0, "McNemar: expected counts of at least 0, found {} and {}", only_a, only_b);
  const long n = only_a + only_b;
  // In logarithms: 2^-n leaves the range of double past n = 1074.
  double log_term = -static_cast<double>(n) * std::log(2.0);
  double tail = 0.0;
  for (long i = 0; i <= std::min(only_a, only_b); ++i) {
    tail += std::exp(log_term);
    log_term += std::log(static_cast<double>(n - i) / static_cast<double>(i + 1));
  }
  return std::min(1.0, 2.0 * tail);
}

double fisher_exact_greater(long k_a, long n_a, long k_b, long n_b) {
  require(0 <= k_a && k_a <= n_a && 0 <= k_b && k_b <= n_b,
          "Fisher: expected counts of 0 to their number, found {} of {} and {} of {}", k_a, n_a, k_b, n_b);
  const long k = k_a + k_b;
  const auto log_choose = [](long n, long r) {
    return std::lgamma(static_cast<double>(n) + 1.0) - std::lgamma(static_cast<double>(r) + 1.0) -
           std::lgamma(static_cast<double>(n - r) + 1.0);
  };
  double tail = 0.0;
  for (long i = k_a; i <= std::min(k, n_a); ++i)
    if (k - i <= n_b) tail += std::exp(log_choose(n_a, i) + log_choose(n_b, k - i) - log_choose(n_a + n_b, k));
  return std::min(1.0, tail);
}

Interval cluster_bootstrap(std::span<const double> values, std::span<const int> cluster, int resamples,
                           std::uint64_t seed, double level) {
  return ClusterBootstrap(resamples, seed).mean(values, cluster, level);
}

ClusterBootstrap::ClusterBootstrap(int resamples, std::uint64_t seed) : resamples_(resamples), seed_(seed) {
  require(resamples > 0, "bootstrap: expected at least 1 resample, found {}", resamples);
}

const std::vector<int>& ClusterBootstrap::draws(int clusters) {
  const auto [found, is_new] = draws_.try_emplace(clusters);
  if (is_new) {
    Random random(seed_, stream_key({"cluster_bootstrap"}));
    found->second.resize(static_cast<std::size_t>(resamples_) * static_cast<std::size_t>(clusters));
    for (int& draw : found->second) draw = random.below(clusters);
  }
  return found->second;
}

Interval ClusterBootstrap::mean(std::span<const double> values, std::span<const int> cluster, double level) {
  return ratio(values, std::vector<double>(values.size(), 1.0), cluster, level);
}

template <typename Statistic>
Interval ClusterBootstrap::percentiles(int clusters, double level, const Statistic& statistic) {
  require_level(level);
  std::span<const int> drawn = draws(clusters);
  std::vector<double> found(static_cast<std::size_t>(resamples_));
  for (double& value : found) {
    value = statistic(drawn.first(static_cast<std::size_t>(clusters)));
    drawn = drawn.subspan(static_cast<std::size_t>(clusters));
  }
  std::erase_if(found, [](double value) { return std::isnan(value); });
  if (found.empty()) return kNoInterval;
  const double low = quantile(found, 0.5 - 0.5 * level);
  return {.low = low, .high = quantile(std::move(found), 0.5 + 0.5 * level)};
}

Interval ClusterBootstrap::ratio(std::span<const double> above, std::span<const double> below,
                                 std::span<const int> cluster, double level) {
  require_samples(above, below, cluster, "divisor");
  const ClusterPlaces places = places_of(cluster);
  struct Sums {
    double above = 0.0, below = 0.0;
  };
  std::vector<Sums> sums(places.clusters);
  for (std::size_t i = 0; i < above.size(); ++i) {
    sums[places.of[i]].above += above[i];
    sums[places.of[i]].below += below[i];
  }
  return percentiles(static_cast<int>(places.clusters), level, [&](std::span<const int> drawn) {
    Sums total;
    for (const int number : drawn) {
      total.above += sums[static_cast<std::size_t>(number)].above;
      total.below += sums[static_cast<std::size_t>(number)].below;
    }
    return total.above / total.below;
  });
}

namespace {

// weighted_median of values whose order is known.
double median_in_order(std::span<const double> values, std::span<const double> weights,
                       std::span<const std::size_t> order) {
  const double half = 0.5 * std::accumulate(weights.begin(), weights.end(), 0.0);
  double below = 0.0;
  for (auto i = order.begin(); i != order.end(); ++i) {
    if (weights[*i] == 0.0) continue;
    below += weights[*i];
    if (below > half) return values[*i];
    if (below < half) continue;
    const auto next = std::find_if(i + 1, order.end(), [&](std::size_t j) { return weights[j] > 0.0; });
    return 0.5 * (values[*i] + values[*next]);
  }
  return std::numeric_limits<double>::quiet_NaN();
}

}  // namespace

Interval ClusterBootstrap::weighted_median(std::span<const double> values, std::span<const double> weights,
                                           std::span<const int> cluster, double level) {
  require_samples(values, weights, cluster, "weight");
  const ClusterPlaces places = places_of(cluster);
  std::vector<std::size_t> order(values.size());  // by value, which draws do not change
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::ranges::stable_sort(order, {}, [&](std::size_t i) { return values[i]; });
  std::vector<double> times(places.clusters), drawn_weights(values.size());
  return percentiles(static_cast<int>(places.clusters), level, [&](std::span<const int> drawn) {
    std::ranges::fill(times, 0.0);
    for (const int number : drawn) times[static_cast<std::size_t>(number)] += 1.0;
    for (std::size_t i = 0; i < values.size(); ++i) drawn_weights[i] = times[places.of[i]] * weights[i];
    return median_in_order(values, drawn_weights, order);
  });
}

Interval ClusterBootstrap::weighted(std::span<const int> cluster,
                                    const std::function<double(std::span<const double>)>& statistic, double level) {
  const ClusterPlaces places = places_of(cluster);
  require(places.clusters > 0, "bootstrap: expected at least one value, found none");
  std::vector<double> times(places.clusters), weights(cluster.size());
  return percentiles(static_cast<int>(places.clusters), level, [&](std::span<const int> drawn) {
    std::ranges::fill(times, 0.0);
    for (const int number : drawn) times[static_cast<std::size_t>(number)] += 1.0;
    for (std::size_t i = 0; i < weights.size(); ++i) weights[i] = times[places.of[i]];
    return statistic(weights);
  });
}

std::vector<double> holm(std::span<const double> p_values) {
  for (const double p : p_values) {
    require(p >= 0.0 && p <= 1.0, "Holm: expected p-values in [0, 1], found {}", p);
  }
  std::vector<std::size_t> order(p_values.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::stable_sort(order.begin(), order.end(), [&](std::size_t i, std::size_t j) { return p_values[i] < p_values[j]; });
  std::vector<double> adjusted(p_values.size());
  double largest = 0.0;
  for (std::size_t rank = 0; rank < order.size(); ++rank) {
    largest = std::max(largest, std::min(1.0, static_cast<double>(order.size() - rank) * p_values[order[rank]]));
    adjusted[order[rank]] = largest;
  }
  return adjusted;
}

double minimum_detectable_difference(double p, long n, double alpha, double power) {
  require(p >= 0.0 && p <= 1.0, "p: expected a proportion in [0, 1], found {}", p);
  const PowerQuantiles z = power_quantiles(n, alpha, power);
  const double size = static_cast<double>(n);
  // An arm that always succeeds (or never) says nothing of the variance; p stays as far from the ends as two successes
  // and two failures more would put it (Agresti and Coull).
  const double inner = std::clamp(p, 2.0 / (size + 4.0), (size + 2.0) / (size + 4.0));
  return std::min(1.0, (z.alpha + z.beta) * std::sqrt(2.0 * inner * (1.0 - inner) / size));
}

double minimum_detectable_difference_paired(double discordance, long n, double alpha, double power) {
  require(discordance >= 0.0 && discordance <= 1.0, "discordance: expected a proportion in [0, 1], found {}",
          discordance);
  const PowerQuantiles z = power_quantiles(n, alpha, power);
  const double size = static_cast<double>(n);
  // d sqrt(n) = z_alpha sqrt(psi) + z_beta sqrt(psi - d^2) (Connor 1987), which is a quadratic in d.
  const double root = size - z.alpha * z.alpha + z.beta * z.beta;
  const double d = std::sqrt(discordance) * (z.alpha * std::sqrt(size) + z.beta * std::sqrt(std::max(root, 0.0))) /
                   (size + z.beta * z.beta);
  return root > 0.0 && d < discordance ? d : one_sided_difference(size, z);
}

// Wichura 1988, algorithm AS 241 (PPND16): relative error about 1e-16.
double normal_quantile(double p) {
  require(p > 0.0 && p < 1.0, "normal quantile: expected p in (0, 1), found {}", p);
  constexpr std::array<double, 8> kA = {3.3871328727963666080e0,  1.3314166789178437745e+2, 1.9715909503065514427e+3,
                                        1.3731693765509461125e+4, 4.5921953931549871457e+4, 6.7265770927008700853e+4,
                                        3.3430575583588128105e+4, 2.5090809287301226727e+3};
  constexpr std::array<double, 8> kB = {1.0,
                                        4.2313330701600911252e+1,
                                        6.8718700749205790830e+2,
                                        5.3941960214247511077e+3,
                                        2.1213794301586595867e+4,
                                        3.9307895800092710610e+4,
                                        2.8729085735721942674e+4,
                                        5.2264952788528545610e+3};
  constexpr std::array<double, 8> kC = {1.42343711074968357734e0,  4.63033784615654529590e0, 5.76949722146069140550e0,
                                        3.64784832476320460504e0,  1.27045825245236838258e0, 2.41780725177450611770e-1,
                                        2.27238449892691845833e-2, 7.74545014278341407640e-4};
  constexpr std::array<double, 8> kD = {1.0,
                                        2.05319162663775882187e0,
                                        1.67638483018380384940e0,
                                        6.89767334985100004550e-1,
                                        1.48103976427480074590e-1,
                                        1.51986665636164571966e-2,
                                        5.47593808499534494600e-4,
                                        1.05075007164441684324e-9};
  constexpr std::array<double, 8> kE = {6.65790464350110377720e0,  5.46378491116411436990e0,  1.78482653991729133580e0,
                                        2.96560571828504891230e-1, 2.65321895265761230930e-2, 1.24266094738807843860e-3,
                                        2.71155556874348757815e-5, 2.01033439929228813265e-7};
  constexpr std::array<double, 8> kF = {1.0,
                                        5.99832206555887937690e-1,
                                        1.36929880922735805310e-1,
                                        1.48753612908506148525e-2,
                                        7.86869131145613259100e-4,
                                        1.84631831751005468180e-5,
                                        1.42151175831644588870e-7,
                                        2.04426310338993978564e-15};
  const double q = p - 0.5;
  if (std::abs(q) <= 0.425) {
    const double r = 0.180625 - q * q;
    return q * polynomial(kA, r) / polynomial(kB, r);
  }
  const double tail = std::sqrt(-std::log(q < 0.0 ? p : 1.0 - p));
  const double x = tail <= 5.0 ? polynomial(kC, tail - 1.6) / polynomial(kD, tail - 1.6)
                               : polynomial(kE, tail - 5.0) / polynomial(kF, tail - 5.0);
  return q < 0.0 ? -x : x;
}

}  // namespace duet
