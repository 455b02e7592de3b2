// The safetensors format: named tensors and a text dictionary in one file. 8 bytes of header length (little endian), a
// JSON header, raw little-endian tensors. We read F16, F32 and F64 (as float) and I64 and I32 (as float, exact up to
// 2^24; larger is refused), and write F32 or F16.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace duet {

enum class TensorType { kF32, kF16 };

struct Tensor {
  std::vector<std::int64_t> shape;
  std::vector<float> values;            // row-major
  std::optional<TensorType> type = {};  // to write it in, where it is not the file's
};

struct SafeTensors {
  std::map<std::string, std::string> metadata;  // the header's __metadata__
  std::map<std::string, Tensor> tensors;
};

// Throws InputError naming file, tensor, expected and found: truncated, a header that is not JSON or longer than the
// file, overlapping or uncovered bytes, a shape that does not give the byte count, an unknown type, a number that is
// not finite.
SafeTensors read_safetensors(const std::string& path);
SafeTensors parse_safetensors(std::string_view bytes, const std::string& file);

// Written to a temporary file beside it and renamed: a killed program leaves the old file or the new one. Throws
// std::invalid_argument where a shape does not give the number of values, a value is not finite or F16 cannot hold it,
// or a name is not UTF-8; InputError where the file cannot be written. The same content gives the same bytes.
void write_safetensors(const std::string& path, const SafeTensors& content, TensorType type = TensorType::kF32);
std::string safetensors_bytes(const SafeTensors& content, TensorType type = TensorType::kF32);

// Vectors, matrices, texts and numbers among the tensors and the metadata of a safetensors file. Reading throws
// InputError naming the file, what is missing, and what was expected and found.

Tensor tensor_of(const Eigen::Ref<const Eigen::VectorXf>& values);
// (columns, rows): a column's numbers follow each other in memory and in the file.
Tensor columns_tensor(const Eigen::Ref<const Eigen::MatrixXf>& matrix);

const Tensor& tensor_named(const SafeTensors& content, const std::string& name, const std::string& file);
Eigen::VectorXf vector_of(const SafeTensors& content, const std::string& name, Eigen::Index size,
                          const std::string& file);
// The matrix that columns_tensor stored.
Eigen::MatrixXf columns_of(const SafeTensors& content, const std::string& name, Eigen::Index rows, Eigen::Index columns,
                           const std::string& file);
std::string text_of(const SafeTensors& content, const std::string& key, const std::string& file);
double number_of(const SafeTensors& content, const std::string& key, const std::string& file);
// Throws unless the metadata of `key` is this; 'format' is a key.
void expect_text(const SafeTensors& content, const std::string& key, const std::string& expected,
                 const std::string& file);

}  // namespace duet
