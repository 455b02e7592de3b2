#include "duet/nn/stored_values.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "duet/core/number.h"
#include "duet/core/require.h"
#include "duet/core/text.h"

namespace duet {
namespace {

constexpr std::size_t kShownText = 200;  // of a text that was expected to be another

}  // namespace

Tensor tensor_of(const Eigen::Ref<const Eigen::VectorXf>& values) {
  return {.shape = {values.size()}, .values = {values.begin(), values.end()}};
}

Tensor columns_tensor(const Eigen::Ref<const Eigen::MatrixXf>& matrix) {
  Tensor tensor{.shape = {matrix.cols(), matrix.rows()}, .values = {}};
  tensor.values.reserve(static_cast<std::size_t>(matrix.size()));
  for (const auto column : matrix.colwise()) tensor.values.insert(tensor.values.end(), column.begin(), column.end());
  return tensor;
}

const Tensor& tensor_named(const SafeTensors& content, const std::string& name, const std::string& file) {
  const auto found = content.tensors.find(name);
  if (found == content.tensors.end()) throw InputError(fmt::format("{}: tensor '{}' is missing", file, name));
  return found->second;
}

Eigen::VectorXf vector_of(const SafeTensors& content, const std::string& name, Eigen::Index size,
                          const std::string& file) {
  const Tensor& found = tensor_named(content, name, file);
  if (static_cast<Eigen::Index>(found.values.size()) != size)
    throw InputError(fmt::format("{}: tensor '{}' has {} values, expected {}", file, name, found.values.size(), size));
  return Eigen::Map<const Eigen::VectorXf>(found.values.data(), size);
}

Eigen::MatrixXf columns_of(const SafeTensors& content, const std::string& name, Eigen::Index rows, Eigen::Index columns,
                           const std::string& file) {
  const Tensor& found = tensor_named(content, name, file);
  if (found.shape != std::vector<std::int64_t>{columns, rows})
    throw InputError(fmt::format("{}: tensor '{}': expected shape ({}, {}), found ({})", file, name, columns, rows,
                                 shown(fmt::format("{}", fmt::join(found.shape, ", ")))));
  return Eigen::Map<const Eigen::MatrixXf>(found.values.data(), rows, columns);
}

std::string text_of(const SafeTensors& content, const std::string& key, const std::string& file) {
  const auto found = content.metadata.find(key);
  if (found == content.metadata.end()) throw InputError(fmt::format("{}: metadata '{}' is missing", file, key));
  return found->second;
}

double number_of(const SafeTensors& content, const std::string& key, const std::string& file) {
  const std::string text = text_of(content, key, file);
  const std::optional<double> value = parse_number(text);
  if (!value) throw InputError(fmt::format("{}: '{}': expected a number, found '{}'", file, key, shown(text)));
  return *value;
}

void expect_text(const SafeTensors& content, const std::string& key, const std::string& expected,
                 const std::string& file) {
  const std::string found = text_of(content, key, file);
  if (found != expected)
    throw InputError(fmt::format("{}: {}: expected '{}', found '{}'", file, key, expected, shown(found, kShownText)));
}

}  // namespace duet
