#include "duet/hardware/frame_checksum.h"

#include <array>

namespace duet {
namespace {

constexpr std::uint32_t kPolynomial = 0x04C11DB7u;
constexpr std::uint32_t kFirst = 0xFFFFFFFFu;
constexpr std::uint32_t kTopBit = 0x80000000u;

constexpr std::uint32_t shifted(std::uint32_t crc) { return (crc << 1) ^ ((crc & kTopBit) != 0 ? kPolynomial : 0u); }

constexpr std::array<std::uint32_t, 256> kTable = [] {
  std::array<std::uint32_t, 256> table{};
  for (std::uint32_t byte = 0; byte < 256; ++byte) {
    std::uint32_t crc = byte << 24;
    for (int bit = 0; bit < 8; ++bit) crc = shifted(crc);
    table[byte] = crc;
  }
  return table;
}();

}  // namespace

std::uint32_t frame_checksum(std::span<const std::uint32_t> words) {
  std::uint32_t crc = kFirst;
  for (const std::uint32_t word : words)
    for (int shift = 24; shift >= 0; shift -= 8) crc = (crc << 8) ^ kTable[(crc >> 24) ^ ((word >> shift) & 0xFFu)];
  return crc;
}

std::uint32_t frame_checksum_by_bits(std::span<const std::uint32_t> words) {
  std::uint32_t crc = kFirst;
  for (const std::uint32_t word : words)
    for (int bit = 31; bit >= 0; --bit) crc = shifted(crc ^ (((word >> bit) & 1u) << 31));
  return crc;
}

}  // namespace duet
