// Edits of safetensors as the bytes of a fuzzer say: texts of the header are replaced, tensors renamed, reshaped and
// changed. Readers of networks and libraries look at these, behind a container that random bytes hardly ever get
// right.
#pragma once

#include <iterator>

#include "duet/nn/safetensors.h"
#include "tests/fuzz/archive_edit.h"

namespace duet::fuzz {

inline void edit_tensor(Bytes& bytes, Tensor& tensor) {
  const auto place = bytes.take<std::uint16_t>();
  if (bytes.take<std::uint8_t>() % 3 == 0 && !tensor.shape.empty()) {
    std::int64_t& size = tensor.shape[place % tensor.shape.size()];
    std::int64_t rest = 1;
    for (const std::int64_t other : tensor.shape) rest *= other;
    rest /= std::max<std::int64_t>(size, 1);
    size = bytes.take<std::uint8_t>() % 5;
    tensor.values.resize(static_cast<std::size_t>(rest * size));
  } else if (!tensor.values.empty()) {
    tensor.values[place % tensor.values.size()] = bytes.take<float>();
  }
}

inline std::string edited_tensors(SafeTensors content, std::string_view program) {
  Bytes bytes(program);
  for (int edits = 0; edits < 4 && !bytes.empty(); ++edits) {
    const int kind = bytes.take<std::uint8_t>() % 4;
    const std::size_t which = bytes.take<std::uint8_t>();
    if (kind == 0 && !content.metadata.empty())
      std::next(content.metadata.begin(), which % content.metadata.size())->second = bytes.take_rest();
    if (kind == 1 && !content.metadata.empty())
      content.metadata.erase(std::next(content.metadata.begin(), which % content.metadata.size()));
    if (kind == 2 && !content.tensors.empty())
      edit_tensor(bytes, std::next(content.tensors.begin(), which % content.tensors.size())->second);
    if (kind == 3 && !content.tensors.empty())
      content.tensors.erase(std::next(content.tensors.begin(), which % content.tensors.size()));
  }
  return safetensors_bytes(content);
}

inline std::string tensors_of(const SafeTensors& sample, std::string_view bytes) {
  return bytes.starts_with(kEdit) ? edited_tensors(sample, bytes.substr(kEdit.size())) : std::string(bytes);
}

// The good file, or a program that puts a text of its header in its place (where mutation begins).
inline std::string tensors_sample(const SafeTensors& content, unsigned seed) {
  if (seed % 2 == 0 || content.metadata.empty()) return safetensors_bytes(content);
  const auto which = static_cast<char>(seed / 64 % content.metadata.size());
  return std::string(kEdit) + '\0' + which + std::next(content.metadata.begin(), which)->second;
}

}  // namespace duet::fuzz
