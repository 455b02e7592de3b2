#include "duet/statistics/by_clip.h"

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

}  // namespace duet
