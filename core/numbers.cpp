#include "duet/core/numbers.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <numeric>

#include "duet/core/digest.h"
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

namespace {

// High and low word of a * b.
std::array<std::uint32_t, 2> multiply(std::uint32_t a, std::uint32_t b) {
  const std::uint64_t product = static_cast<std::uint64_t>(a) * b;
  return {static_cast<std::uint32_t>(product >> 32), static_cast<std::uint32_t>(product)};
}

std::uint32_t low(std::uint64_t value) { return static_cast<std::uint32_t>(value); }
std::uint32_t high(std::uint64_t value) { return static_cast<std::uint32_t>(value >> 32); }

}  // namespace

std::array<std::uint32_t, 4> philox(std::array<std::uint32_t, 4> counter, std::array<std::uint32_t, 2> key) {
  constexpr std::uint32_t kMultiplier0 = 0xD2511F53, kMultiplier1 = 0xCD9E8D57;
  constexpr std::uint32_t kWeyl0 = 0x9E3779B9, kWeyl1 = 0xBB67AE85;
  for (int round = 0; round < 10; ++round) {
    const auto [high0, low0] = multiply(kMultiplier0, counter[0]);
    const auto [high1, low1] = multiply(kMultiplier1, counter[2]);
    counter = {high1 ^ counter[1] ^ key[0], low1, high0 ^ counter[3] ^ key[1], low0};
    key = {key[0] + kWeyl0, key[1] + kWeyl1};
  }
  return counter;
}

std::uint64_t Random::bits() {
  if (used_ == 4) {
    block_ = philox({low(counter_), high(counter_), low(stream_), high(stream_)}, {low(seed_), high(seed_)});
    ++counter_;
    used_ = 0;
  }
  const std::uint64_t word = block_[static_cast<std::size_t>(used_)];
  const std::uint64_t value = word | static_cast<std::uint64_t>(block_[static_cast<std::size_t>(used_) + 1]) << 32;
  used_ += 2;
  return value;
}

double Random::uniform() { return static_cast<double>(bits() >> 11) * 0x1.0p-53; }

double Random::uniform(double low, double high) {
  const double value = low + (high - low) * uniform();
  return value < high ? value : std::nextafter(high, low);  // rounding may reach `high`
}

double Random::normal() {
  const double radius = std::sqrt(-2.0 * std::log1p(-uniform()));  // 1 - u is never 0
  return radius * std::cos(2.0 * std::numbers::pi * uniform());
}

int Random::below(int n) {
  require(n > 0, "random number below n: expected n > 0, found {}", n);
  const auto range = static_cast<std::uint64_t>(n);
  const std::uint64_t excess = (0 - range) % range;  // 2^64 mod n: that many values would count once too often
  std::uint64_t value = bits();
  while (value < excess) value = bits();
  return static_cast<int>(value % range);
}

std::uint64_t stream_key(std::initializer_list<std::string_view> parts) {
  Sha256 hash;
  for (const std::string_view part : parts) {
    hash.update(fmt::format("{}:", part.size()));
    hash.update(part);
  }
  return std::stoull(hash.hex().substr(0, 16), nullptr, 16);
}

}  // namespace duet
