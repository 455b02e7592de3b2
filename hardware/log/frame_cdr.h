// The maker's low-level messages as CDR (XCDR1, little-endian), as DDS sends them and as readers of logs take them. A
// frame has the layout of the C struct; CDR has no padding in front of a member that needs none: the octet `mode` of
// the first motor follows the two bytes before it, and everything behind it begins four bytes earlier. Pure functions
// without allocation; thread-safe.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstring>
#include <span>

#include "duet/hardware/wire/low_level_frame.h"

namespace duet {

inline constexpr std::size_t kCdrHeadBytes = 4;     // says that CDR follows, and its byte order
inline constexpr std::size_t kCdrShorterBy = 4;     // than the struct, without that head
inline constexpr std::size_t kCommandMotorsAt = 4;  // of the struct: where its motors begin
inline constexpr std::size_t kStateMotorsAt = 72;
static_assert(offsetof(LowCommandFrame, motor) == kCommandMotorsAt && offsetof(LowStateFrame, motor) == kStateMotorsAt);

template <typename Frame>
inline constexpr std::size_t kCdrBytes = kCdrHeadBytes + sizeof(Frame) - kCdrShorterBy;

template <typename Frame>
using FrameCdr = std::array<std::byte, kCdrBytes<Frame>>;

// Before the motors stand two bytes of padding, behind a motor's octet three.
constexpr std::size_t motors_at(const LowCommandFrame&) { return kCommandMotorsAt; }
constexpr std::size_t motors_at(const LowStateFrame&) { return kStateMotorsAt; }

template <typename Frame>
FrameCdr<Frame> cdr_of(const Frame& frame) {
  const auto from = std::as_bytes(std::span(&frame, 1));
  const std::size_t motors = motors_at(frame);
  FrameCdr<Frame> cdr{};
  cdr[1] = std::byte{1};  // little-endian
  auto to = cdr.begin() + kCdrHeadBytes;
  to = std::copy_n(from.begin(), motors - 2, to);
  *to++ = from[motors];  // the mode of the first motor
  *to++ = std::byte{0};
  std::copy(from.begin() + static_cast<std::ptrdiff_t>(motors) + 4, from.end(), to);
  return cdr;
}

// False where `data` is no such message; its padding is 0 again. A struct behind the head, as logs once had it, is
// taken as it lies.
template <typename Frame>
bool read_cdr(std::span<const std::byte> data, Frame& frame) {
  constexpr std::byte kLittleEndian[2] = {std::byte{0}, std::byte{1}};
  if (data.size() < kCdrHeadBytes || !std::equal(kLittleEndian, kLittleEndian + 2, data.begin())) return false;
  if (data.size() == kCdrHeadBytes + sizeof(Frame)) {
    std::memcpy(&frame, data.data() + kCdrHeadBytes, sizeof(Frame));
    return true;
  }
  if (data.size() != kCdrBytes<Frame>) return false;
  const std::size_t motors = motors_at(frame);
  std::memset(&frame, 0, sizeof(frame));
  const auto to = std::as_writable_bytes(std::span(&frame, 1));
  const auto body = data.subspan(kCdrHeadBytes);
  std::copy_n(body.begin(), motors - 2, to.begin());
  to[motors] = body[motors - 2];
  std::copy(body.begin() + static_cast<std::ptrdiff_t>(motors), body.end(),
            to.begin() + static_cast<std::ptrdiff_t>(motors) + 4);
  return true;
}

}  // namespace duet
