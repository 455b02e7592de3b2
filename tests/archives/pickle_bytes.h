// Pickles for tests, written opcode by opcode as NumPy would.
#pragma once

#include <algorithm>
#include <cstdint>
#include <cstring>
#include <string>
#include <vector>

namespace duet::test {

class PickleWriter {
 public:
  explicit PickleWriter(int protocol = 4) : protocol_(protocol) { out_ = {'\x80', static_cast<char>(protocol)}; }

  PickleWriter& raw(const std::string& bytes) {
    out_ += bytes;
    return *this;
  }
  PickleWriter& little(std::uint64_t value, int size) {
    for (int i = 0; i < size; ++i) out_ += static_cast<char>(value >> (8 * i) & 0xff);
    return *this;
  }
  PickleWriter& text(const std::string& value) { return raw("X").little(value.size(), 4).raw(value); }
  PickleWriter& integer(std::int32_t value) { return raw("J").little(static_cast<std::uint32_t>(value), 4); }
  PickleWriter& real(double value) {
    std::uint64_t bits;
    std::memcpy(&bits, &value, 8);
    raw("G");
    for (int i = 7; i >= 0; --i) out_ += static_cast<char>(bits >> (8 * i) & 0xff);
    return *this;
  }
  PickleWriter& none() { return raw("N"); }
  PickleWriter& call(const std::string& module, const std::string& name) {
    return protocol_ >= 4 ? text(module).text(name).raw("\x93") : raw("c" + module + "\n" + name + "\n");
  }
  // Protocol 2 has no bytes: it keeps them as Latin-1 text in UTF-8.
  PickleWriter& bytes(const std::string& value) {
    if (protocol_ > 2) return raw("B").little(value.size(), 4).raw(value);
    std::string utf8;
    for (const unsigned char c : value) {
      if (c >= 0x80) utf8 += static_cast<char>(0xc0 | c >> 6);
      utf8 += static_cast<char>(c < 0x80 ? c : 0x80 | (c & 0x3f));
    }
    return call("_codecs", "encode").text(utf8).text("latin1").raw("\x86R");
  }
  PickleWriter& dtype(const std::string& code, const std::string& order = "<") {
    call("numpy", "dtype").text(code).raw("\x89\x88\x87R(").integer(3).text(order).raw("NNN");
    return integer(-1).integer(-1).integer(0).raw("tb");
  }
  PickleWriter& array(const std::vector<int>& shape, const std::string& values, const std::string& code = "f8",
                      const std::string& order = "<", bool fortran = false) {
    call("numpy.core.multiarray", "_reconstruct")
        .call("numpy", "ndarray")
        .integer(0)
        .raw("\x85")
        .bytes("b")
        .raw("\x87R(");
    integer(1).raw("(");
    for (const int size : shape) integer(size);
    return raw("t").dtype(code, order).raw(fortran ? "\x88" : "\x89").bytes(values).raw("tb");
  }
  PickleWriter& doubles(const std::vector<int>& shape, const std::vector<double>& values) {
    return array(shape, packed(values));
  }
  // As joblib.dump writes it: a description, then the bytes, aligned to `alignment` (0: as before joblib 1.2).
  PickleWriter& joblib_array(const std::vector<int>& shape, const std::string& values, const std::string& code = "f8",
                             bool fortran = false, int alignment = 16, const std::string& order = "<") {
    call("joblib.numpy_pickle", "NumpyArrayWrapper").raw(")\x81}(");
    text("subclass").call("numpy", "ndarray").text("shape").raw("(");
    for (const int size : shape) integer(size);
    raw("t").text("order").text(fortran ? "F" : "C").text("dtype").dtype(code, order).text("allow_mmap").raw("\x88");
    if (alignment > 0) text("numpy_array_alignment_bytes").integer(alignment);
    raw("ub");
    if (alignment > 0) {
      const std::size_t padding = alignment - (out_.size() + 1) % alignment;
      little(padding, 1).raw(std::string(padding, '\xff'));
    }
    return raw(values);
  }
  PickleWriter& joblib_doubles(const std::vector<int>& shape, const std::vector<double>& values) {
    return joblib_array(shape, packed(values));
  }
  [[nodiscard]] const std::string& str() const { return out_; }

  static std::string packed_floats(const std::vector<double>& values) {
    const std::vector<float> singles(values.begin(), values.end());
    return {reinterpret_cast<const char*>(singles.data()), 4 * singles.size()};
  }
  static std::string packed(const std::vector<double>& values, bool big_endian = false) {
    std::string bytes(8 * values.size(), '\0');
    std::memcpy(bytes.data(), values.data(), bytes.size());
    if (big_endian)
      for (std::size_t i = 0; i < bytes.size(); i += 8) std::reverse(&bytes[i], &bytes[i] + 8);
    return bytes;
  }

 private:
  int protocol_;
  std::string out_;
};

}  // namespace duet::test
