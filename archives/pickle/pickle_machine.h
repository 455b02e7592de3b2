// The part of Python's pickle format (protocols 2 to 5) that dicts of NumPy arrays, numbers, strings and lists use. A
// file builds passive nodes and nothing else: no class is ever looked up, and no call made; the names that its flavour
// knows stand for arrays. Work and memory are linear in the size of the file; nothing recurses. Thread-safe.
#pragma once

#include <fmt/format.h>

#include <cstdint>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "duet/archives/pickle/pickle_node.h"
#include "duet/core/require.h"

namespace duet {

// `bytes` must outlive the result. Throws InputError naming file, byte offset, expected and found.
Pickle parse_pickle(std::string_view bytes, const std::string& name, PickleFlavour flavour = PickleFlavour::kNumPy);

// Values of an array or NumPy scalar of f2, f4, f8, i1..i8 or u1..u8, in C order. `what` stands in messages. Throws
// InputError for another node or type, or a size that does not match the shape.
std::vector<double> array_values(const Pickle& pickle, const PickleNode& node, const std::string& what);

struct PickleNumbers {
  std::vector<std::size_t> shape;  // empty for a single number
  std::vector<double> values;      // in C order
};

// Numbers in any of the ways in which programs put them: a number, an array as above, lists and tuples of these, nested
// up to 8 deep and all of one shape. Throws InputError as above, for lists that disagree and for more than 2^22 numbers
// in lists.
PickleNumbers pickle_numbers(const Pickle& pickle, const PickleNode& node, const std::string& what);

// One number, alone or in brackets of any kind, or as text ("30"). Throws InputError for anything else.
double pickle_number(const Pickle& pickle, const PickleNode& node, const std::string& what);

// The bytes of a pickle, taken from front to back. Whatever is asked for beyond the end throws InputError naming file
// and byte; nothing is allocated by a length that the file claims.
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
