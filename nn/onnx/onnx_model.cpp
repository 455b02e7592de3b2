#include "duet/nn/onnx/onnx_model.h"

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <onnx/onnx_pb.h>

#include <Eigen/Core>
#include <algorithm>
#include <charconv>
#include <climits>
#include <cmath>
#include <cstring>
#include <filesystem>
#include <set>

#include "duet/core/file.h"
#include "duet/core/require.h"

namespace duet {
namespace {

using onnx::AttributeProto;
using onnx::TensorProto;

// Values of one stored type out of a tensor's raw bytes or out of the field that protobuf keeps for it.
template <typename Stored, typename Out, typename Field>
std::vector<Out> values_of(const TensorProto& tensor, const Field& field) {
  std::vector<Out> values;
  if (!tensor.has_raw_data()) {
    for (const auto value : field) values.push_back(static_cast<Out>(value));
    return values;
  }
  const std::string& raw = tensor.raw_data();
  values.reserve(raw.size() / sizeof(Stored));
  for (std::size_t at = 0; at + sizeof(Stored) <= raw.size(); at += sizeof(Stored)) {
    Stored value;
    std::memcpy(&value, raw.data() + at, sizeof value);
    values.push_back(static_cast<Out>(value));
  }
  return values;
}

bool is_external(const TensorProto& tensor) {
  return tensor.data_location() == TensorProto::EXTERNAL || tensor.external_data_size() > 0;
}

std::vector<float> halves_of(const TensorProto& tensor) {
  std::vector<float> values;
  for (const auto bits : values_of<std::uint16_t, std::uint16_t>(tensor, tensor.int32_data()))
    values.push_back(Eigen::half_impl::half_to_float(Eigen::half_impl::raw_uint16_to_half(bits)));
  return values;
}

class Parser {
 public:
  Parser(const std::string& file, const std::string& folder) : external_(folder) { graph_.file = file; }

  OnnxGraph parse(std::string_view bytes) {
    onnx::ModelProto model;
    if (bytes.empty() || bytes.size() > INT_MAX || !model.ParseFromArray(bytes.data(), static_cast<int>(bytes.size())))
      refuse("expected an ONNX model, found bytes that are not one (truncated?)");
    graph_.opset = opset(model);
    for (const auto& entry : model.metadata_props()) graph_.metadata[entry.key()] = entry.value();
    read(model.graph());
    return std::move(graph_);
  }

 private:
  [[noreturn]] void refuse(const std::string& problem) const {
    throw InputError(fmt::format("'{}': {}", graph_.file, excerpt(problem, kShownSentence)));
  }

  [[nodiscard]] int opset(const onnx::ModelProto& model) const {
    for (const auto& import : model.opset_import()) {
      if (!own_domain(import.domain())) continue;
      if (import.version() < kOldestOpset || import.version() > kNewestOpset)
        refuse(fmt::format("ONNX operator set: expected {} to {}, found {}", kOldestOpset, kNewestOpset,
                           import.version()));
      return static_cast<int>(import.version());
    }
    refuse("expected an ONNX model with an operator set, found none (truncated?)");
  }

  static bool own_domain(const std::string& domain) { return domain.empty() || domain == "ai.onnx"; }

  void read(const onnx::GraphProto& graph) {
    if (graph.sparse_initializer_size() > 0) refuse("expected dense constants, found a sparse one");
    for (const TensorProto& constant : graph.initializer())
      if (!graph_.constants.emplace(constant.name(), tensor(constant, constant.name())).second)
        refuse(fmt::format("constant '{}' stands in the file twice", constant.name()));
    for (const auto& input : graph.input())
      if (!graph_.constants.contains(input.name())) graph_.inputs.push_back(port(input, "input"));
    for (const auto& output : graph.output()) graph_.outputs.push_back(port(output, "output"));
    for (const auto& found : graph.node()) graph_.nodes.push_back(node(found));
    if (graph_.outputs.empty()) refuse("expected outputs, found none (truncated?)");
  }

  [[nodiscard]] OnnxPort port(const onnx::ValueInfoProto& info, const std::string& kind) const {
    const std::string place = fmt::format("{} '{}'", kind, info.name());
    const auto& type = info.type().tensor_type();
    if (!info.type().has_tensor_type() || (kind == "input" && type.elem_type() != TensorProto::FLOAT))
      refuse(fmt::format("{}: expected a tensor of float, found {}", place, type_name(type.elem_type())));
    OnnxPort port{info.name(), {}};
    for (const auto& dim : type.shape().dim()) {
      if (dim.has_dim_value() && dim.dim_value() < 1)
        refuse(fmt::format("{}: expected sizes from 1, found {}", place, dim.dim_value()));
      port.shape.push_back(dim.has_dim_value() ? dim.dim_value() : -1);
    }
    return port;
  }

  static std::string type_name(int type) {
    return TensorProto::DataType_IsValid(type) ? TensorProto::DataType_Name(static_cast<TensorProto::DataType>(type))
                                               : fmt::format("type {}", type);
  }

  [[nodiscard]] OnnxTensor tensor(const TensorProto& from, const std::string& name) const {
    const std::string place = fmt::format("constant '{}'", name);
    OnnxTensor tensor;
    tensor.shape.assign(from.dims().begin(), from.dims().end());
    read_values(is_external(from) ? with_external_bytes(from, place) : from, place, tensor);
    check_count(tensor, place);
    check_finite(tensor, place);
    return tensor;
  }

  // The tensor as if its bytes stood in the model's own file.
  [[nodiscard]] TensorProto with_external_bytes(const TensorProto& from, const std::string& place) const {
    if (external_.folder().empty())
      refuse(place + ": expected its numbers in the file, found them in another (external data)");
    const std::string where = fmt::format("'{}': {}", graph_.file, excerpt(place));
    TensorProto tensor = from;
    tensor.set_raw_data(external_.read(external_place(from, place), where));
    return tensor;
  }

  [[nodiscard]] ExternalPlace external_place(const TensorProto& from, const std::string& place) const {
    ExternalPlace at;
    for (const auto& entry : from.external_data()) {
      if (entry.key() == "location")
        at.location = entry.value();
      else if (entry.key() == "offset")
        at.offset = byte_count(entry.value(), place);
      else if (entry.key() == "length")
        at.length = byte_count(entry.value(), place);
      else if (entry.key() != "checksum")  // optional, and the run's own digest covers the file
        refuse(fmt::format("{}: external data: expected location, offset, length or checksum, found '{}'", place,
                           excerpt(entry.key())));
    }
    return at;
  }

  [[nodiscard]] std::int64_t byte_count(const std::string& text, const std::string& place) const {
    std::int64_t count = -1;
    const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), count);
    if (error != std::errc() || end != text.data() + text.size() || count < 0)
      refuse(fmt::format("{}: external data: expected a number of bytes, found '{}'", place, excerpt(text)));
    return count;
  }

  void read_values(const TensorProto& from, const std::string& place, OnnxTensor& to) const {
    to.type = ElementType::kInteger;
    switch (from.data_type()) {
      case TensorProto::FLOAT:
        to.type = ElementType::kFloat;
        to.floats = values_of<float, float>(from, from.float_data());
        return;
      case TensorProto::DOUBLE:
        to.type = ElementType::kFloat;
        to.floats = values_of<double, float>(from, from.double_data());
        return;
      case TensorProto::FLOAT16:
        to.type = ElementType::kFloat;
        to.floats = halves_of(from);
        return;
      case TensorProto::INT64:
        to.integers = values_of<std::int64_t, std::int64_t>(from, from.int64_data());
        return;
      case TensorProto::INT32:
        to.integers = values_of<std::int32_t, std::int64_t>(from, from.int32_data());
        return;
      case TensorProto::BOOL:
        to.type = ElementType::kBoolean;
        to.integers = values_of<std::uint8_t, std::int64_t>(from, from.int32_data());
        for (std::int64_t& value : to.integers) value = value != 0 ? 1 : 0;
        return;
      default:
        refuse(fmt::format("{}: expected FLOAT, DOUBLE, FLOAT16, INT64, INT32 or BOOL, found {}", place,
                           type_name(from.data_type())));
    }
  }

  void check_count(const OnnxTensor& tensor, const std::string& place) const {
    const std::size_t found = std::max(tensor.floats.size(), tensor.integers.size());
    std::size_t expected = 1;
    for (const std::int64_t size : tensor.shape) {
      // A product beyond what was found stays beyond it unless a size is 0, so it is cut there against overflow.
      if (size < 0) refuse(fmt::format("{}: expected sizes from 0, found {}", place, size));
      expected = size == 0 ? 0 : std::min(expected, found + 1) * std::min<std::size_t>(size, found + 1);
    }
    if (expected != found)
      refuse(fmt::format("{}: shape ({}) does not give the {} values found (truncated?)", place,
                         fmt::join(tensor.shape, ", "), found));
  }

  void check_finite(const OnnxTensor& tensor, const std::string& place) const {
    for (const float value : tensor.floats)
      if (std::isnan(value) || (std::isinf(value) && tensor.floats.size() > 1))
        refuse(fmt::format("{}: expected finite numbers, found {}", place, value));
  }

  [[nodiscard]] OnnxNode node(const onnx::NodeProto& from) const {
    OnnxNode node;
    node.op = own_domain(from.domain()) ? from.op_type() : from.domain() + "." + from.op_type();
    node.name = from.name().empty() ? fmt::format("{}#{}", node.op, graph_.nodes.size()) : from.name();
    node.inputs.assign(from.input().begin(), from.input().end());
    node.outputs.assign(from.output().begin(), from.output().end());
    for (const AttributeProto& attribute : from.attribute())
      if (!node.attributes.emplace(attribute.name(), value(attribute, node)).second)
        refuse(fmt::format("node '{}' ({}): attribute '{}' stands there twice", node.name, node.op, attribute.name()));
    return node;
  }

  [[nodiscard]] OnnxAttribute value(const AttributeProto& from, const OnnxNode& node) const {
    switch (from.type()) {
      case AttributeProto::INT:
        return from.i();
      case AttributeProto::FLOAT:
        return from.f();
      case AttributeProto::STRING:
        return from.s();
      case AttributeProto::INTS:
        return std::vector<std::int64_t>(from.ints().begin(), from.ints().end());
      case AttributeProto::FLOATS:
        return std::vector<float>(from.floats().begin(), from.floats().end());
      case AttributeProto::STRINGS:
        return std::vector<std::string>(from.strings().begin(), from.strings().end());
      case AttributeProto::TENSOR:
        return tensor(from.t(), node.name);
      default:
        refuse(fmt::format("node '{}': operator {} is not supported (attribute '{}' is of another kind)", node.name,
                           node.op, from.name()));
    }
  }

  mutable ExternalData external_;  // keeps what it has read; its folder is "" where there is none
  OnnxGraph graph_;
};

void add_location(const TensorProto& tensor, std::set<std::string>& locations) {
  if (!is_external(tensor)) return;
  for (const auto& entry : tensor.external_data())
    if (entry.key() == "location") locations.insert(entry.value());
}

}  // namespace

OnnxGraph parse_onnx(std::string_view bytes, const std::string& file, const std::string& folder) {
  return Parser(file, folder).parse(bytes);
}

std::set<std::string> external_locations(std::string_view bytes) {
  onnx::ModelProto model;
  if (bytes.size() > INT_MAX || !model.ParseFromArray(bytes.data(), static_cast<int>(bytes.size()))) return {};
  std::set<std::string> locations;
  for (const TensorProto& constant : model.graph().initializer()) add_location(constant, locations);
  for (const auto& node : model.graph().node())
    for (const AttributeProto& attribute : node.attribute())
      if (attribute.has_t()) add_location(attribute.t(), locations);
  return locations;
}

namespace {

namespace fs = std::filesystem;

bool climbs(const fs::path& path) {
  return std::any_of(path.begin(), path.end(), [](const fs::path& part) { return part == ".."; });
}

// Links followed, as far as the path exists.
bool is_below(const fs::path& folder, const fs::path& file) {
  std::error_code error;
  const fs::path top = fs::weakly_canonical(folder, error), found = fs::weakly_canonical(file, error);
  return !error && std::mismatch(top.begin(), top.end(), found.begin(), found.end()).first == top.end();
}

}  // namespace

std::string location_fault(const std::string& folder, const std::string& location) {
  const fs::path path(location);
  if (location.empty() || location.find('\0') != std::string::npos || path.is_absolute() || climbs(path))
    return fmt::format("expected external data at a path below the model's folder, found '{}'", excerpt(location));
  const fs::path file = fs::path(folder) / path;
  if (!is_below(folder, file))
    return fmt::format("expected external data in the model's folder, found that '{}' leads out of it",
                       excerpt(location));
  std::error_code ignored;
  if (!fs::is_regular_file(file, ignored))
    return fmt::format("expected external data in the file '{}', found none", excerpt(file.string()));
  return "";
}

std::string ExternalData::read(const ExternalPlace& place, const std::string& where) {
  const auto refuse = [&](const std::string& problem) {
    throw InputError(fmt::format("{}: {}", where, excerpt(problem, kShownSentence)));
  };
  if (const std::string fault = location_fault(folder_, place.location); !fault.empty()) refuse(fault);
  auto found = files_.find(place.location);
  if (found == files_.end())
    found = files_.emplace(place.location, read_file((fs::path(folder_) / place.location).string())).first;
  const std::string& bytes = found->second;
  const auto size = static_cast<std::int64_t>(bytes.size());
  const std::int64_t length = place.length.value_or(size - std::min(size, place.offset));
  if (place.offset > size || length > size - place.offset) {
    require_data((fs::path(folder_) / place.location).string());
    refuse(fmt::format("expected {} bytes from {} on in '{}', found a file of {} (truncated?)", length, place.offset,
                       place.location, size));
  }
  if (length > kMostExternalBytes)
    refuse(fmt::format("expected at most {} bytes in '{}', found {}", kMostExternalBytes, place.location, length));
  return bytes.substr(static_cast<std::size_t>(place.offset), static_cast<std::size_t>(length));
}

}  // namespace duet
