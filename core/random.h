// Counter-based random numbers (Philox4x32-10): value n of stream (seed, stream) does not depend on any other stream,
// on the thread or on the order of work. docs/architecture.md, 8.
#pragma once

#include <array>
#include <cstdint>
#include <initializer_list>
#include <string_view>

namespace duet {

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
