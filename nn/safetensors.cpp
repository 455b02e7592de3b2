#include "duet/nn/safetensors.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <cstring>
#include <nlohmann/json.hpp>
#include <optional>

#include "duet/core/file.h"
#include "duet/core/json.h"
#include "duet/core/require.h"

namespace duet {
namespace {

using Json = nlohmann::json;

constexpr const char* kMetadata = "__metadata__";
constexpr std::size_t kLengthBytes = 8, kAlignment = 8;
constexpr std::int64_t kExactInteger = 1 << 24;

// Number of values of a shape, none where a size is negative or the count is beyond 2^48 (more than memory holds).
std::optional<std::uint64_t> count_of(const std::vector<std::int64_t>& shape) {
  constexpr std::uint64_t kLimit = std::uint64_t{1} << 48;
  std::uint64_t count = 1;
  for (const std::int64_t size : shape) {
    if (size < 0 || (size > 0 && count > kLimit / static_cast<std::uint64_t>(size))) return std::nullopt;
    count *= static_cast<std::uint64_t>(size);
  }
  return count;
}

template <typename T>
T load(const char* bytes) {
  T value;
  std::memcpy(&value, bytes, sizeof(T));
  return value;
}

float half_at(const char* bytes) {
  return Eigen::half_impl::half_to_float(Eigen::half_impl::raw_uint16_to_half(load<std::uint16_t>(bytes)));
}

template <typename T>
std::optional<float> exact_at(const char* bytes) {
  const std::int64_t value = load<T>(bytes);
  if (value < -kExactInteger || value > kExactInteger) return std::nullopt;
  return static_cast<float>(value);
}

// How one value of a type is read; none where float does not hold it.
struct StoredType {
  std::string_view name;
  std::uint64_t bytes;
  std::optional<float> (*value_at)(const char* bytes);
};

constexpr StoredType kStoredTypes[] = {
    {"F16", 2, [](const char* bytes) { return std::optional<float>(half_at(bytes)); }},
    {"F32", 4, [](const char* bytes) { return std::optional<float>(load<float>(bytes)); }},
    {"F64", 8, [](const char* bytes) { return std::optional<float>(static_cast<float>(load<double>(bytes))); }},
    {"I32", 4, exact_at<std::int32_t>},
    {"I64", 8, exact_at<std::int64_t>},
};

// A tensor as the header tells of it; the bytes are relative to the header's end.
struct Entry {
  std::string name;
  const StoredType* type = nullptr;
  std::vector<std::int64_t> shape;
  std::uint64_t begin = 0, end = 0;
};

class Reader {
 public:
  Reader(std::string_view bytes, const std::string& file) : file_(file) {
    if (bytes.size() < kLengthBytes)
      refuse("", fmt::format("expected 8 bytes of header length, found {}", bytes.size()));
    const auto length = load<std::uint64_t>(bytes.data());
    const std::size_t rest = bytes.size() - kLengthBytes;
    if (length > rest) refuse("", fmt::format("expected a header of {} bytes, found {} (truncated?)", length, rest));
    header_ = parsed(bytes.substr(kLengthBytes, length));
    data_ = bytes.substr(kLengthBytes + length);
  }

  [[nodiscard]] SafeTensors read() const {
    SafeTensors content;
    std::vector<Entry> entries;
    for (const auto& [name, value] : header_.items()) {
      if (name == kMetadata)
        content.metadata = metadata(value);
      else
        entries.push_back(entry(name, value));
    }
    check_cover(entries);
    for (const Entry& entry : entries) content.tensors[entry.name] = {entry.shape, values(entry)};
    return content;
  }

 private:
  [[noreturn]] void refuse(const std::string& tensor, const std::string& problem) const {
    throw InputError(tensor.empty() ? fmt::format("'{}': safetensors: {}", file_, excerpt(problem, kShownSentence))
                                    : fmt::format("'{}': tensor '{}': {}", file_, excerpt(tensor),
                                                  excerpt(problem, kShownSentence)));
  }

  [[nodiscard]] Json parsed(std::string_view text) const {
    Json header = parse_json(text, fmt::format("'{}': safetensors: header", file_));
    if (!header.is_object()) refuse("", fmt::format("expected a JSON object as header, found {}", header.type_name()));
    return header;
  }

  [[nodiscard]] std::map<std::string, std::string> metadata(const Json& value) const {
    std::map<std::string, std::string> metadata;
    if (!value.is_object()) refuse(kMetadata, fmt::format("expected an object, found {}", value.type_name()));
    for (const auto& [key, text] : value.items()) {
      if (!text.is_string())
        refuse(kMetadata, fmt::format("'{}': expected a string, found {}", excerpt(key), text.type_name()));
      metadata[key] = text.get<std::string>();
    }
    return metadata;
  }

  [[nodiscard]] Entry entry(const std::string& name, const Json& value) const {
    if (!value.is_object()) refuse(name, fmt::format("expected an object, found {}", value.type_name()));
    Entry entry;
    entry.name = name;
    entry.type = &type(name, value);
    for (const std::uint64_t size : naturals(name, value, "shape")) {
      if (size > static_cast<std::uint64_t>(INT64_MAX)) refuse(name, fmt::format("shape: {} is too large", size));
      entry.shape.push_back(static_cast<std::int64_t>(size));
    }
    const std::vector<std::uint64_t> offsets = naturals(name, value, "data_offsets");
    if (offsets.size() != 2) refuse(name, fmt::format("data_offsets: expected 2 numbers, found {}", offsets.size()));
    entry.begin = offsets[0];
    entry.end = offsets[1];
    check_size(entry);
    return entry;
  }

  [[nodiscard]] const StoredType& type(const std::string& name, const Json& value) const {
    const auto found = value.find("dtype");
    if (found == value.end() || !found->is_string()) refuse(name, "expected a string 'dtype', found none");
    std::vector<std::string_view> known;
    for (const StoredType& type : kStoredTypes) {
      if (*found == type.name) return type;
      known.push_back(type.name);
    }
    refuse(name, fmt::format("dtype: expected one of {}, found '{}'", fmt::join(known, ", "),
                             excerpt(found->get_ref<const std::string&>())));
  }

  [[nodiscard]] std::vector<std::uint64_t> naturals(const std::string& name, const Json& value, const char* key) const {
    const auto found = value.find(key);
    if (found == value.end() || !found->is_array())
      refuse(name, fmt::format("expected an array '{}', found none", key));
    std::vector<std::uint64_t> numbers;
    for (const Json& number : *found) {
      if (!number.is_number_unsigned()) refuse(name, fmt::format("{}: expected whole numbers from 0", key));
      numbers.push_back(number.get<std::uint64_t>());
    }
    return numbers;
  }

  void check_size(const Entry& entry) const {
    if (entry.begin > entry.end || entry.end > data_.size())
      refuse(entry.name, fmt::format("data_offsets: expected an interval in [0, {}], found [{}, {}] (truncated?)",
                                     data_.size(), entry.begin, entry.end));
    const std::optional<std::uint64_t> count = count_of(entry.shape);
    const std::uint64_t found = entry.end - entry.begin;
    if (!count || *count * entry.type->bytes != found)
      refuse(entry.name, fmt::format("shape ({}) of {} does not give the {} bytes found", fmt::join(entry.shape, ", "),
                                     entry.type->name, found));
  }

  // Each byte belongs to one tensor.
  void check_cover(std::vector<Entry> entries) const {
    std::ranges::sort(
        entries, [](const Entry& a, const Entry& b) { return std::pair(a.begin, a.end) < std::pair(b.begin, b.end); });
    std::uint64_t end = 0;
    for (const Entry& entry : entries) {
      if (entry.begin != end)
        refuse(entry.name, fmt::format("expected to begin at byte {}, found {} ({})", end, entry.begin,
                                       entry.begin < end ? "overlap" : "gap"));
      end = entry.end;
    }
    if (end != data_.size()) refuse("", fmt::format("expected {} bytes of tensors, found {}", end, data_.size()));
  }

  [[nodiscard]] std::vector<float> values(const Entry& entry) const {
    std::vector<float> values;
    values.reserve((entry.end - entry.begin) / entry.type->bytes);
    for (std::uint64_t at = entry.begin; at < entry.end; at += entry.type->bytes) {
      const std::optional<float> value = entry.type->value_at(data_.data() + at);
      if (!value)
        refuse(entry.name, fmt::format("expected integers within 2^24, found a larger one at index {}", values.size()));
      if (!std::isfinite(*value))
        refuse(entry.name, fmt::format("expected finite numbers, found {} at index {}", *value, values.size()));
      values.push_back(*value);
    }
    return values;
  }

  std::string file_;
  Json header_;
  std::string_view data_;
};

std::string_view name_of(TensorType type) { return type == TensorType::kF16 ? "F16" : "F32"; }

template <typename T>
void append(std::string& bytes, T value) {
  bytes.append(reinterpret_cast<const char*>(&value), sizeof(T));
}

void append_tensor(std::string& bytes, const std::string& name, const Tensor& tensor, TensorType type) {
  const std::optional<std::uint64_t> count = count_of(tensor.shape);
  require(count == tensor.values.size(), "tensor '{}': shape ({}) does not give the {} values found", name,
          fmt::join(tensor.shape, ", "), tensor.values.size());
  for (const float value : tensor.values) {
    if (!std::isfinite(value))  // the sentence is made only where it is needed: files hold many numbers
      throw std::invalid_argument(fmt::format("tensor '{}': expected finite numbers, found {}", name, value));
    if (type == TensorType::kF32) {
      append(bytes, value);
      continue;
    }
    const auto half = Eigen::half(value);
    if (!(Eigen::numext::isfinite)(half))
      throw std::invalid_argument(fmt::format("tensor '{}': F16 cannot hold {}", name, value));
    append(bytes, half.x);
  }
}

std::string header_text(const Json& header) {
  std::string text = dumped(header);
  require(Json::parse(text) == header, "safetensors: expected names and metadata in UTF-8, found other bytes");
  text.append((kAlignment - text.size() % kAlignment) % kAlignment, ' ');
  return text;
}

}  // namespace

SafeTensors read_safetensors(const std::string& path) { return parse_safetensors(read_data(path), path); }

SafeTensors parse_safetensors(std::string_view bytes, const std::string& file) { return Reader(bytes, file).read(); }

void write_safetensors(const std::string& path, const SafeTensors& content, TensorType type) {
  write_file(path, safetensors_bytes(content, type));
}

std::string safetensors_bytes(const SafeTensors& content, TensorType type) {
  Json header = Json::object();
  if (!content.metadata.empty()) header[kMetadata] = content.metadata;
  std::string data;
  for (const auto& [name, tensor] : content.tensors) {
    require(name != kMetadata, "a tensor cannot have the name '{}'", kMetadata);
    const std::size_t begin = data.size();
    const TensorType stored = tensor.type.value_or(type);
    append_tensor(data, name, tensor, stored);
    header[name] = {{"dtype", name_of(stored)}, {"shape", tensor.shape}, {"data_offsets", {begin, data.size()}}};
  }
  const std::string text = header_text(header);
  std::string bytes;
  append(bytes, static_cast<std::uint64_t>(text.size()));
  return bytes + text + data;
}

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
                                 excerpt(fmt::format("{}", fmt::join(found.shape, ", ")))));
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
  if (!value) throw InputError(fmt::format("{}: '{}': expected a number, found '{}'", file, key, excerpt(text)));
  return *value;
}

void expect_text(const SafeTensors& content, const std::string& key, const std::string& expected,
                 const std::string& file) {
  const std::string found = text_of(content, key, file);
  if (found != expected)
    throw InputError(fmt::format("{}: {}: expected '{}', found '{}'", file, key, expected, excerpt(found, kShownText)));
}

}  // namespace duet
