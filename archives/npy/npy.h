// One array in NumPy's NPY format (the entries of an NPZ archive). Strict: nothing beyond plain numbers, booleans and
// strings is read, and nothing in a file is ever executed. Pure functions, thread-safe.
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "duet/archives/npy/npy_array.h"

namespace duet {

// Number of values of a shape. Throws InputError where it is above `limit`.
std::size_t checked_count(const std::vector<std::size_t>& shape, std::size_t limit);

// Throws InputError saying what is wrong with these bytes; the caller puts the names in front.
NpyArray parse_npy(std::string_view bytes);

// Version 1.0, little-endian, C order. Throws InputError for an array above 1 GiB.
std::string npy_bytes(const NpyArray& array);

// Code points of UTF-8 text. Throws std::invalid_argument where it is not UTF-8 or holds a NUL, which NumPy drops at
// the end of a string.
std::u32string decode_utf8(std::string_view text);

}  // namespace duet
