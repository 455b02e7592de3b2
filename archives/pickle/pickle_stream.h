// The bytes of a pickle, taken from front to back. Whatever is asked for beyond the end throws InputError naming file
// and byte; nothing is allocated by a length that the file claims.
#pragma once

#include <fmt/format.h>

#include <cstdint>
#include <string>
#include <string_view>
#include <utility>

#include "duet/core/require.h"

namespace duet {

class PickleStream {
 public:
  // `bytes` must outlive it.
  PickleStream(std::string_view bytes, std::string name) : bytes_(bytes), name_(std::move(name)) {}

  [[nodiscard]] std::size_t left() const { return bytes_.size() - position_; }
  [[nodiscard]] std::size_t opcode() const { return opcode_; }  // where the present one begins

  unsigned char next_opcode() {
    opcode_ = position_;
    return static_cast<unsigned char>(unsigned_number(1));
  }

  std::string_view take(std::uint64_t size) {
    if (size > left())
      fail(fmt::format("the file is truncated: expected {} more bytes at byte {}, found {}", size, position_, left()));
    const std::string_view part = bytes_.substr(position_, size);
    position_ += size;
    return part;
  }

  // Little-endian, of at most 8 bytes.
  std::uint64_t unsigned_number(int size) {
    std::uint64_t value = 0;
    const std::string_view part = take(static_cast<std::uint64_t>(size));
    for (int i = size - 1; i >= 0; --i) value = value << 8 | static_cast<unsigned char>(part[i]);
    return value;
  }

  // LONG1: one byte of length, then as many of the number.
  std::int64_t long_number() {
    const int size = static_cast<int>(unsigned_number(1));
    if (size > 8) fail(fmt::format("expected an integer of at most 8 bytes, found {}", size));
    if (size == 0) return 0;
    const std::uint64_t value = unsigned_number(size) << (64 - 8 * size);
    return static_cast<std::int64_t>(value) >> (64 - 8 * size);
  }

  std::string_view line() {
    const std::size_t end = bytes_.find('\n', position_);
    if (end == std::string_view::npos) fail("the file is truncated inside the name of a class");
    const std::string_view text = bytes_.substr(position_, end - position_);
    position_ = end + 1;
    return text;
  }

  [[noreturn]] void fail(const std::string& fault) const {
    throw InputError(fmt::format("'{}': byte {}: {}", name_, opcode_, fault));
  }

 private:
  std::string_view bytes_;
  std::string name_;
  std::size_t position_ = 0;
  std::size_t opcode_ = 0;
};

}  // namespace duet
