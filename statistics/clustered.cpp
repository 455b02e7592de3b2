#include "duet/statistics/clustered.h"

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <map>
#include <vector>

#include "duet/core/require.h"

namespace duet {
namespace {

constexpr double kNoSpread = 1e-12;  // sums of squares below are rounding

// How many independent values of the variance given tell as much of the mean as these do, and no more than there are
// clips.
double independent_values(std::span<const double> values, double mean, double variance, std::span<const int> cluster) {
  std::map<int, double> off;
  for (std::size_t i = 0; i < values.size(); ++i) off[cluster[i]] += values[i] - mean;
  double squares = 0.0;
  for (const auto& [id, sum] : off) squares += sum * sum;
  const double n = static_cast<double>(values.size()), clips = static_cast<double>(off.size());
  return squares > kNoSpread && variance > kNoSpread ? std::min(clips, variance * n * n / squares) : clips;
}

void require_shares(std::span<const double> values, std::span<const int> cluster) {
  require(!values.empty(), "shares by clip: expected at least one value, found none");
  require(values.size() == cluster.size(), "shares by clip: expected one clip a value, found {} for {}", cluster.size(),
          values.size());
  require(std::ranges::all_of(values, [](double value) { return value >= 0.0 && value <= 1.0 + kNoSpread; }),
          "shares by clip: expected values of 0 to 1");
}

// The chance that the sum of so many numbers, each with either sign, is `total` or more on either side.
double flipped_tail(std::span<const long> sums, long total) {
  double squares = 0.0;
  long largest = 0;
  for (const long sum : sums) {
    squares += static_cast<double>(sum) * static_cast<double>(sum);
    largest = std::max(largest, std::abs(sum));
  }
  // A sum twelve standard deviations away has a chance of 0 in doubles.
  const long reach = largest + std::lround(std::ceil(12.0 * std::sqrt(squares)));
  std::vector<double> chance(static_cast<std::size_t>(2 * reach + 1), 0.0), next(chance.size());  // from -reach on
  chance[static_cast<std::size_t>(reach)] = 1.0;
  long filled = 0;
  for (const long sum : sums) {
    std::ranges::fill(next, 0.0);
    for (long i = -filled; i <= filled; ++i)
      for (const long at : {i - sum, i + sum})
        if (std::abs(at) <= reach)
          next[static_cast<std::size_t>(reach + at)] += 0.5 * chance[static_cast<std::size_t>(reach + i)];
    filled = std::min(filled + std::abs(sum), reach);
    chance.swap(next);
  }
  double tail = 0.0;
  for (long i = -reach; i <= reach; ++i)
    if (std::abs(i) >= std::abs(total)) tail += chance[static_cast<std::size_t>(reach + i)];
  return std::min(1.0, tail);
}

}  // namespace

double sign_flip_exact(std::span<const long> sums) {
  std::vector<long> told;  // clips without a difference tell nothing
  long for_a = 0, total = 0;
  for (const long sum : sums) {
    if (sum == 0) continue;
    told.push_back(sum);
    for_a += sum > 0 ? 1 : 0;
    total += sum;
  }
  const bool same_size = std::ranges::all_of(told, [&](long sum) { return std::abs(sum) == std::abs(told.front()); });
  return same_size ? mcnemar_exact(for_a, static_cast<long>(told.size()) - for_a) : flipped_tail(told, total);
}

Interval wilson_by_clip(std::span<const double> values, std::span<const int> cluster, double level) {
  require_shares(values, cluster);
  double mean = 0.0;
  for (const double value : values) mean += value;
  mean /= static_cast<double>(values.size());
  const double n = independent_values(values, mean, mean * (1.0 - mean), cluster);
  return wilson_of(mean * n, n, level);
}

Interval newcombe_by_clip(std::span<const double> a, std::span<const double> b, std::span<const int> cluster,
                          double level) {
  require_shares(a, cluster);
  require_shares(b, cluster);
  PairCounts pairs;
  std::vector<double> differences(a.size());
  double squares = 0.0;
  for (std::size_t i = 0; i < a.size(); ++i) {
    pairs.both += a[i] * b[i];
    pairs.only_a += a[i] * (1.0 - b[i]);
    pairs.only_b += (1.0 - a[i]) * b[i];
    pairs.neither += (1.0 - a[i]) * (1.0 - b[i]);
    differences[i] = a[i] - b[i];
    squares += differences[i] * differences[i];
  }
  const double size = static_cast<double>(a.size());
  const double mean = (pairs.only_a - pairs.only_b) / size;
  const double n = independent_values(differences, mean, squares / size - mean * mean, cluster);
  for (double* count : {&pairs.both, &pairs.only_a, &pairs.only_b, &pairs.neither}) *count *= n / size;
  return newcombe_of(pairs, level);
}

namespace {

constexpr double kRounding = 1e-20;  // squared errors below are no spread

// Continued fraction of the regularised incomplete beta function by Lentz's method; converges for x < (a + 1) / (a + b
// + 2).
double beta_fraction(double a, double b, double x) {
  constexpr double kTiny = 1e-300, kEnough = 1e-15;
  constexpr int kTerms = 500;
  const auto away_from_zero = [](double value) { return std::abs(value) < kTiny ? kTiny : value; };
  double c = 1.0, d = 1.0 / away_from_zero(1.0 - (a + b) * x / (a + 1.0)), fraction = d;
  for (int m = 1; m <= kTerms; ++m) {
    const double even = m * (b - m) * x / ((a + 2 * m - 1.0) * (a + 2 * m));
    const double odd = -(a + m) * (a + b + m) * x / ((a + 2 * m) * (a + 2 * m + 1.0));
    double step = 1.0;
    for (const double term : {even, odd}) {
      d = 1.0 / away_from_zero(1.0 + term * d);
      c = away_from_zero(1.0 + term / c);
      step = c * d;
      fraction *= step;
    }
    if (std::abs(step - 1.0) < kEnough) break;
  }
  return fraction;
}

double incomplete_beta(double a, double b, double x) {
  if (x <= 0.0) return 0.0;
  if (x >= 1.0) return 1.0;
  const double front =
      std::exp(std::lgamma(a + b) - std::lgamma(a) - std::lgamma(b) + a * std::log(x) + b * std::log1p(-x));
  if (x < (a + 1.0) / (a + b + 2.0)) return front * beta_fraction(a, b, x) / a;
  return 1.0 - front * beta_fraction(b, a, 1.0 - x) / b;
}

// The squared standard error of the mean of `values`.
double squared_error(const std::vector<double>& values) {
  const double deviation = sample_deviation(values);
  return deviation * deviation / static_cast<double>(values.size());
}

std::vector<double> means_of(const TrainingOutcomes& method) {
  std::vector<double> means;
  means.reserve(method.size());
  for (const std::vector<double>& training : method) means.push_back(mean_of(training));
  return means;
}

std::vector<double> mean_over_trainings(const TrainingOutcomes& method) {
  std::vector<double> means(method.front().size(), 0.0);
  for (const std::vector<double>& training : method)
    for (std::size_t i = 0; i < means.size(); ++i) means[i] += training[i] / static_cast<double>(method.size());
  return means;
}

// The squared standard error of the mean difference per episode, clips of unequal size drawn as wholes.
double squared_error_of_clips(const std::vector<double>& differences, std::span<const int> clip, double mean,
                              std::size_t& clips) {
  std::map<int, double> off;  // by clip, the sum of what its episodes differ from the mean
  for (std::size_t i = 0; i < differences.size(); ++i) off[clip[i]] += differences[i] - mean;
  double sum = 0.0;
  for (const auto& [id, value] : off) sum += value * value;
  clips = off.size();
  const auto k = static_cast<double>(clips), n = static_cast<double>(differences.size());
  return k / (k - 1.0) * sum / (n * n);
}

void require_crossed(const TrainingOutcomes& a, const TrainingOutcomes& b, std::span<const int> clip) {
  require(a.size() >= 2 && b.size() >= 2, "trainings: expected two or more of each method, found {} and {}", a.size(),
          b.size());
  for (const TrainingOutcomes* method : {&a, &b})
    for (const std::vector<double>& training : *method)
      require(training.size() == clip.size(), "trainings: expected {} episodes of each, found {}", clip.size(),
              training.size());
  require(std::any_of(clip.begin(), clip.end(), [&](int id) { return id != clip.front(); }),
          "trainings: expected two clips or more");
}

}  // namespace

double student_two_sided(double t, double degrees) {
  return incomplete_beta(0.5 * degrees, 0.5, degrees / (degrees + t * t));
}

double student_quantile(double level, double degrees) {
  require(level > 0.0 && level < 1.0, "level: expected a number in (0, 1), found {}", level);
  double low = 0.0, high = 1.0;
  while (student_two_sided(high, degrees) > 1.0 - level) high *= 2.0;
  for (int i = 0; i < 100; ++i) {
    const double middle = 0.5 * (low + high);
    (student_two_sided(middle, degrees) > 1.0 - level ? low : high) = middle;
  }
  return high;
}

CrossedDifference crossed_difference(const TrainingOutcomes& a, const TrainingOutcomes& b, std::span<const int> clip,
                                     double level) {
  require_crossed(a, b, clip);
  const std::vector<double> of_a = mean_over_trainings(a), of_b = mean_over_trainings(b);
  std::vector<double> differences(clip.size());
  std::transform(of_a.begin(), of_a.end(), of_b.begin(), differences.begin(), std::minus<>());
  CrossedDifference result;
  result.difference = mean_of(differences);
  std::size_t clips = 0;
  const double from_clips = squared_error_of_clips(differences, clip, result.difference, clips);
  const double from_a = squared_error(means_of(a)), from_b = squared_error(means_of(b));
  const double all = from_a + from_b + from_clips;
  result.error = std::sqrt(all);
  if (!(all > kRounding)) {
    result.degrees = std::numeric_limits<double>::infinity();
    // Without any spread the clips alone say how sure it is.
    result.interval = newcombe_by_clip(of_a, of_b, clip, level);
    result.p = sign_flip_exact(std::vector<long>(result.difference == 0.0 ? 0 : clips, 1));
    return result;
  }
  const auto freedom = [](std::size_t n) { return static_cast<double>(n) - 1.0; };
  result.of_trainings = (from_a + from_b) / all;
  result.degrees = all * all /
                   (from_a * from_a / freedom(a.size()) + from_b * from_b / freedom(b.size()) +
                    from_clips * from_clips / freedom(clips));
  const double half = student_quantile(level, result.degrees) * result.error;
  result.interval = {result.difference - half, result.difference + half};
  result.p = student_two_sided(result.difference / result.error, result.degrees);
  return result;
}

}  // namespace duet
