// The checksum of the G1's low-level messages: CRC-32/MPEG-2 (polynomial 0x04C11DB7, first value 0xFFFFFFFF, nothing
// reflected, nothing inverted at the end) over 32-bit words, each from its highest bit. Source: unitree_sdk2,
// crc32_core.
#pragma once

#include <cstdint>
#include <cstring>
#include <span>
#include <type_traits>

namespace duet {

std::uint32_t frame_checksum(std::span<const std::uint32_t> words);
// The same bit by bit, as the definition has it: what the table is tested against.
std::uint32_t frame_checksum_by_bits(std::span<const std::uint32_t> words);

// The checksum of all words of a message but its last, which holds it. Padding counts: a message is built from zeros.
template <typename Frame>
std::uint32_t checksum_of(const Frame& frame) {
  static_assert(std::is_trivially_copyable_v<Frame> && sizeof(Frame) % sizeof(std::uint32_t) == 0);
  std::uint32_t words[sizeof(Frame) / sizeof(std::uint32_t)];
  std::memcpy(words, &frame, sizeof(Frame));
  return frame_checksum(std::span<const std::uint32_t>(words).first(std::size(words) - 1));
}

}  // namespace duet
