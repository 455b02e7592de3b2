// The header of an NPY array: a Python dictionary literal of three keys, read by its grammar and not evaluated.
#pragma once

#include <string>
#include <string_view>
#include <vector>

namespace duet {

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
// (archives/pickle/npy_objects.h).
NpyHeader parse_npy_header(std::string_view bytes, bool objects = false);

}  // namespace duet
