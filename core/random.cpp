#include "duet/core/random.h"

#include <fmt/format.h>

#include <cmath>
#include <numbers>

#include "duet/core/digest.h"
#include "duet/core/require.h"

namespace duet {
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
