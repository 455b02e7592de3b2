// Edits of an archive as the bytes of a fuzzer say. A zip archive guards its entries with checksums, so mutated bytes
// hardly ever reach the readers of the arrays; edits do.
#pragma once

#include <cstring>
#include <string>
#include <variant>
#include <vector>

#include "duet/archives/npy/npz.h"

namespace duet::fuzz {

class Bytes {
 public:
  explicit Bytes(std::string_view bytes) : bytes_(bytes) {}
  [[nodiscard]] bool empty() const { return bytes_.empty(); }
  template <typename T>
  T take() {
    T value{};
    const std::size_t size = std::min(sizeof(T), bytes_.size());
    std::memcpy(&value, bytes_.data(), size);
    bytes_.remove_prefix(size);
    return value;
  }
  std::string take_text() {
    const std::size_t size = std::min<std::size_t>(take<std::uint8_t>() % 40, bytes_.size());
    std::string text(bytes_.substr(0, size));
    bytes_.remove_prefix(size);
    std::erase_if(text, [](char c) { return c <= 0; });  // what NumPy text can hold without a codec
    return text;
  }
  // Everything that is left, as text of a header: what is not UTF-8 is left out.
  std::string take_rest() {
    std::string text(bytes_);
    bytes_ = {};
    std::erase_if(text, [](char c) { return c < 0; });
    return text;
  }

 private:
  std::string_view bytes_;
};

// Bytes of a fuzzer as an archive: themselves, or where they begin with "edit" a program of edits of `sample`.
inline constexpr std::string_view kEdit = "edit";

inline void edit_value(Bytes& bytes, NpyArray& array) {
  const auto place = bytes.take<std::uint16_t>();
  std::visit(
      [&](auto& values) {
        if (values.empty()) return;
        auto& value = values[place % values.size()];
        using Value = std::remove_reference_t<decltype(value)>;
        if constexpr (std::is_same_v<Value, std::string>)
          value = bytes.take_text();
        else
          value = bytes.take<Value>();
      },
      array.values);
}

// Another count of the same numbers, or the same count in another shape.
inline void edit_shape(Bytes& bytes, NpyArray& array) {
  const std::size_t rows = bytes.take<std::uint8_t>() % 5;
  std::size_t row_size = 1;
  for (std::size_t d = 1; d < array.shape.size(); ++d) row_size *= array.shape[d];
  if (array.shape.empty() || bytes.take<std::uint8_t>() % 2 == 0) {
    std::visit([&](auto& values) { values.resize(rows); }, array.values);
    array.shape = {rows};
  } else {
    std::visit([&](auto& values) { values.resize(rows * row_size); }, array.values);
    array.shape[0] = rows;
  }
}

inline std::string edited_archive(Npz npz, std::string_view program) {
  Bytes bytes(program);
  for (int edits = 0; edits < 8 && !bytes.empty(); ++edits) {
    const std::vector<std::string> keys = npz.keys();
    const std::string key = keys[bytes.take<std::uint8_t>() % keys.size()];
    NpyArray array = npz.array(key);
    switch (bytes.take<std::uint8_t>() % 4) {
      case 0:
        edit_value(bytes, array);
        break;
      case 1:
        edit_shape(bytes, array);
        break;
      case 2:
        array = npz.array(keys[bytes.take<std::uint8_t>() % keys.size()]);
        break;
      default:
        npz.set(bytes.take_text() + "x", array);
        break;
    }
    npz.set(key, array);
  }
  return npz.bytes();
}

inline std::string archive_of(const Npz& sample, std::string_view bytes) {
  return bytes.starts_with(kEdit) ? edited_archive(sample, bytes.substr(kEdit.size())) : std::string(bytes);
}

}  // namespace duet::fuzz
