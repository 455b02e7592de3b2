#include "duet/statistics/crossed_effects.h"

#include <algorithm>
#include <cmath>
#include <map>

#include "duet/core/require.h"
#include "duet/statistics/by_clip.h"

namespace duet {
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
