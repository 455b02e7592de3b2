// One array in NumPy's NPY format (the entries of an NPZ archive). Strict: nothing beyond plain numbers, booleans and
// strings is read, and nothing in a file is ever executed. Pure functions, thread-safe.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <variant>
#include <vector>

namespace duet {

// An array as NumPy stores it, and how large one may be.

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

// Number of values of a shape. Throws InputError where it is above `limit`.
std::size_t checked_count(const std::vector<std::size_t>& shape, std::size_t limit);

// Throws InputError saying what is wrong with these bytes; the caller puts the names in front.
NpyArray parse_npy(std::string_view bytes);

// Version 1.0, little-endian, C order. Throws InputError for an array above 1 GiB.
std::string npy_bytes(const NpyArray& array);

// Code points of UTF-8 text. Throws std::invalid_argument where it is not UTF-8 or holds a NUL, which NumPy drops at
// the end of a string.
std::u32string decode_utf8(std::string_view text);

// The header of an NPY array: a Python dictionary literal of three keys, read by its grammar and not evaluated.

struct NpyType {
  char kind = 'f';  // f, i, u, b, U, S; O where objects are asked for
  bool big_endian = false;
  std::size_t size = 8;  // of one value [bytes]
};

struct NpyHeader {
  NpyType type;
  bool fortran_order = false;
  std::vector<std::size_t> shape;
  std::size_t data_begin = 0;  // [bytes]
};

// "(240, 29)", "(3,)", "()".
std::string shape_text(const std::vector<std::size_t>& shape);

// Versions 1.0, 2.0, 3.0. Throws InputError saying what is wrong. An array of objects is refused unless asked for
// (archives/pickle/pickle_files.h).
NpyHeader parse_npy_header(std::string_view bytes, bool objects = false);

}  // namespace duet
