// Numbers that several rooms need: statistics of order, halves of 16 bits, a smooth step, random streams.
#pragma once

#include <array>
#include <cmath>
#include <cstdint>
#include <initializer_list>
#include <limits>
#include <span>
#include <string_view>
#include <vector>

namespace duet {

// Statistics of order: quantiles, rank correlation, times that are known only up to where watching ended. Pure
// functions.

// Linear between order statistics (the usual "type 7"). NaN for no values. p in [0, 1].
double quantile_of_sorted(std::span<const double> sorted, double p);
double quantile(std::vector<double> values, double p);

// The value below and above which the weights sum to the same, the mean of two where half ends between them. NaN for no
// weight. For ratios y / x weighted by |x| it is the slope through the origin with the least absolute deviations of y.
// Throws std::invalid_argument for unequal lengths and for negative weights.
double weighted_median(std::span<const double> values, std::span<const double> weights);

struct RankAgreement {
  long pairs = 0, concordant = 0, discordant = 0;  // of items; a pair tied in a or b is neither
  double tau_b = 0.0;                              // NaN where all of a or all of b are tied, or items are fewer than 2
};
// Kendall's tau-b. Values within 1e-9 of each other are tied. Throws std::invalid_argument for unequal lengths.
// Source: Kendall, "The treatment of ties in ranking problems", Biometrika 33, 1945.
RankAgreement kendall(std::span<const double> a, std::span<const double> b);

struct Lifetime {
  double time = 0.0;
  bool ended = false;  // false: censored, still going on at `time`
};
// First time at which the Kaplan-Meier estimate of those still going on is at most 1 - p; NaN where it never is. Where
// ends and censorings share a time, the ends come first. p in (0, 1). Source: Kaplan and Meier, JASA 53, 1958.
double kaplan_meier_quantile(std::vector<Lifetime> lifetimes, double p);

// Numbers of 16 bits (IEEE 754 binary16), as arrays of others store them.
inline double number_of_half(std::uint16_t bits) {
  const int exponent = bits >> 10 & 0x1f;
  const double fraction = bits & 0x3ff;
  const double sign = (bits & 0x8000) != 0 ? -1.0 : 1.0;
  if (exponent == 0x1f)
    return fraction == 0.0 ? sign * std::numeric_limits<double>::infinity() : std::numeric_limits<double>::quiet_NaN();
  return sign * (exponent == 0 ? std::ldexp(fraction, -24) : std::ldexp(1024.0 + fraction, exponent - 25));
}

// The cubic from 0 to 1 that sets out and arrives at rest.

// s in [0, 1]; who goes beyond it bounds s first.
constexpr double smooth_step(double s) { return s * s * (3.0 - 2.0 * s); }

// Counter-based random numbers (Philox4x32-10): value n of stream (seed, stream) does not depend on any other stream,
// on the thread or on the order of work. docs/architecture.md, 8.

class Random {
 public:
  Random(std::uint64_t seed, std::uint64_t stream) : seed_(seed), stream_(stream) {}

  std::uint64_t bits();                     // 64 uniform bits
  double uniform();                         // [0, 1), 53 bits
  double uniform(double low, double high);  // [low, high)
  double normal();                          // standard normal (Box-Muller, own sequence; no std:: distribution)
  int below(int n);                         // {0, ..., n-1}, unbiased; throws std::invalid_argument for n <= 0
  bool chance(double p) { return uniform() < p; }

 private:
  std::uint64_t seed_;
  std::uint64_t stream_;
  std::uint64_t counter_ = 0;
  std::array<std::uint32_t, 4> block_{};
  int used_ = 4;
};

// One block of Philox4x32-10. Source: Salmon et al., "Parallel random numbers: as easy as 1, 2, 3", SC11.
std::array<std::uint32_t, 4> philox(std::array<std::uint32_t, 4> counter, std::array<std::uint32_t, 2> key);

// A stream number from what names it, for example {"hhoi-core@1.0.0", "handshake", clip, "12", "policy"}: the first 8
// bytes of SHA-256 over the parts, each preceded by its length.
std::uint64_t stream_key(std::initializer_list<std::string_view> parts);

}  // namespace duet
