// An array as NumPy stores it, and how large one may be.
#pragma once

#include <cstdint>
#include <string>
#include <variant>
#include <vector>

namespace duet {

inline constexpr std::size_t kMaxEntryBytes = std::size_t{1} << 30;  // of one array, header included
inline constexpr std::size_t kMaxArrayValues = kMaxEntryBytes / 8;   // as many as fit in 1 GiB once they are doubles
inline constexpr std::size_t kMaxArrayStrings = std::size_t{1} << 22;

// Row-major values with a shape; an empty shape is a scalar. Read from: f4, f8 -> double; i1..i8, u1..u4, b1 -> int64;
// U, S -> strings. Both byte orders and both memory orders are read; little-endian C order is written (<f8, <i8, <U).
struct NpyArray {
  using Values = std::variant<std::vector<double>, std::vector<std::int64_t>, std::vector<std::string>>;
  std::vector<std::size_t> shape;
  Values values;
};

}  // namespace duet
