#include "duet/statistics/sequential_test.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "duet/core/require.h"

namespace duet {
namespace {

// A factor of two between neighbours loses little against the best stake in hindsight, which is about difference over
// discordance: from .02 (two points where all pairs disagree) to 1.
constexpr std::array<double, 7> kStakes = {0.02, 0.04, 0.08, 0.16, 0.32, 0.64, 0.95};
constexpr double kEdge = 1.0 - 1e-9;  // of the means that are tried

double log_mean_exp(const std::array<double, kStakes.size()>& logs) {
  const double largest = *std::max_element(logs.begin(), logs.end());
  double sum = 0.0;
  for (const double value : logs) sum += std::exp(value - largest);
  return largest + std::log(sum / static_cast<double>(logs.size()));
}

// Where an increasing `is_past` turns true in [low, high], from the side named.
template <typename IsPast>
double turning_point(double low, double high, const IsPast& is_past) {
  for (int i = 0; i < 50; ++i) {
    const double middle = 0.5 * (low + high);
    (is_past(middle) ? high : low) = middle;
  }
  return 0.5 * (low + high);
}

}  // namespace

void SequentialTest::add_round(std::span<const double> differences) {
  for (const double difference : differences) {
    require(difference >= -1.0 && difference <= 1.0, "sequential test: expected a difference in [-1, 1], found {}",
            difference);
  }
  for (const double difference : differences) {
    ++counts_[difference];
    ++observations_;
    sum_ += difference;
  }
  largest_e_ = std::max(largest_e_, e_value());
}

double SequentialTest::difference() const {
  return observations_ > 0 ? sum_ / static_cast<double>(observations_) : std::numeric_limits<double>::quiet_NaN();
}

double SequentialTest::log_capital(double m, bool above) const {
  require(m > -1.0 && m < 1.0, "sequential test: expected a mean in (-1, 1), found {}", m);
  const double side = above ? 1.0 : -1.0;
  std::array<double, kStakes.size()> logs{};
  for (const auto& [difference, count] : counts_) {
    const double gain = (1.0 + side * difference) / (1.0 + side * m) - 1.0;
    for (std::size_t i = 0; i < kStakes.size(); ++i)
      logs[i] += static_cast<double>(count) * std::log1p(kStakes[i] * gain);
  }
  return log_mean_exp(logs);
}

double SequentialTest::e_value() const {
  return 0.5 * (std::exp(log_capital(0.0, true)) + std::exp(log_capital(0.0, false)));
}

double SequentialTest::anytime_p() const { return std::min(1.0, 1.0 / largest_e_); }

Interval SequentialTest::interval(double alpha) const {
  require(alpha > 0.0 && alpha < 1.0, "alpha: expected a number in (0, 1), found {}", alpha);
  if (observations_ == 0) return {.low = -1.0, .high = 1.0};
  const double limit = std::log(2.0 / alpha);
  const auto refused = [&](double m, bool above) { return log_capital(m, above) >= limit; };
  // The capital for a larger mean falls with m, that for a smaller one rises.
  const double low =
      refused(-kEdge, true) ? turning_point(-kEdge, kEdge, [&](double m) { return !refused(m, true); }) : -1.0;
  const double high =
      refused(kEdge, false) ? turning_point(-kEdge, kEdge, [&](double m) { return refused(m, false); }) : 1.0;
  return {.low = low, .high = high};
}

std::string_view to_string(SequentialDecision verdict) {
  switch (verdict) {
    case SequentialDecision::kUndecided:
      break;
    case SequentialDecision::kBetter:
      return "better";
    case SequentialDecision::kWorse:
      return "worse";
    case SequentialDecision::kSame:
      return "same within the margin";
  }
  return "undecided";
}

SequentialDecision verdict_of(const Interval& interval, double margin) {
  require(margin > 0.0 && margin < 1.0, "margin: expected a number in (0, 1), found {}", margin);
  if (interval.low > -margin && interval.high < margin) return SequentialDecision::kSame;
  if (interval.low > 0.0) return SequentialDecision::kBetter;
  if (interval.high < 0.0) return SequentialDecision::kWorse;
  return SequentialDecision::kUndecided;
}

}  // namespace duet
