#include "duet/nn/onnx/onnx_plan.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>

#include "duet/core/require.h"

namespace duet {
namespace {

constexpr std::int64_t kExactInFloat = 1 << 24;

const OnnxOperator* find_operator(std::string_view name) {
  for (const auto table : {elementwise_operators(), movement_operators(), shape_operators(), linear_operators(),
                           reduction_operators(), recurrent_operators()})
    for (const OnnxOperator& found : table)
      if (found.name == name) return &found;
  return nullptr;
}

void build(OnnxPlan& plan, const OnnxGraph& graph, const OnnxNode& node) {
  OnnxBuilder builder(plan, graph, node);
  const OnnxOperator* found = find_operator(node.op);
  if (found == nullptr) builder.refuse("not supported");
  const int inputs = builder.input_count();
  if (inputs < found->least_inputs || inputs > found->most_inputs)
    builder.refuse(fmt::format("expected {} to {} inputs, found {}", found->least_inputs, found->most_inputs, inputs));
  for (int i = 0; i < found->least_inputs; ++i)
    if (!builder.has_input(i)) builder.refuse(fmt::format("expected an input {}, found none", i));
  for (int i = found->most_outputs; i < builder.output_count(); ++i)
    if (builder.has_output(i))
      builder.refuse(fmt::format("expected up to {} outputs, found output {}", found->most_outputs, i));
  if (!builder.has_output(0)) builder.refuse("expected an output, found none");
  found->build(builder);
}

// The plan's memory is its own: a constant is copied once.
OnnxValue constant_value(OnnxPlan& plan, const OnnxTensor& tensor, const std::string& file) {
  OnnxValue value;
  value.type = tensor.type;
  value.shape = tensor.shape;
  value.constant = true;
  value.integers = tensor.integers;
  if (tensor.type != ElementType::kFloat) return value;
  value.data = plan.arena.take(static_cast<std::int64_t>(tensor.floats.size()));
  if (value.data == nullptr) throw InputError(fmt::format("'{}': its constants are too large", file));
  std::ranges::copy(tensor.floats, value.data);
  return value;
}

OnnxValue input_value(OnnxPlan& plan, const OnnxPort& port, const std::string& file) {
  OnnxValue value;
  value.shape = port.shape;
  for (std::int64_t& size : value.shape) size = std::abs(size);  // -1, an open size, becomes 1
  value.data = plan.arena.take(value.count());
  if (value.data == nullptr)
    throw InputError(fmt::format("'{}': input '{}': shape {} is too large", file, excerpt(port.name),
                                 excerpt(shape_text(value.shape))));
  return value;
}

}  // namespace

std::int64_t count_of(const Shape& shape) {
  std::int64_t count = 1;
  for (const std::int64_t size : shape) {
    // Cut above the arena's limit, so that no product overflows; the arena then refuses it.
    count = std::min(count, OnnxArena::kLimit + 1) * std::min(size, OnnxArena::kLimit + 1);
  }
  return count;
}

std::string shape_text(const Shape& shape) { return fmt::format("({})", fmt::join(shape, ", ")); }

std::int64_t OnnxValue::count() const { return count_of(shape); }

float* OnnxArena::take(std::int64_t count) {
  constexpr std::int64_t kBlock = 1 << 14, kLine = 16;  // floats: 64 KiB, and a line of the cache
  if (count < 0 || count > kLimit - total_) return nullptr;
  const std::int64_t rounded = (count + kLine) / kLine * kLine;  // never 0: every value has an address of its own
  if (rounded > room_) {
    room_ = std::max(kBlock, rounded);
    blocks_.emplace_back(static_cast<std::size_t>(room_ + kLine), 0.0F);
    next_ = blocks_.back().data();
    while (reinterpret_cast<std::uintptr_t>(next_) % (kLine * sizeof(float)) != 0) ++next_;
  }
  float* taken = next_;
  next_ += rounded;
  room_ -= rounded;
  total_ += rounded;
  return taken;
}

OnnxBuilder::OnnxBuilder(OnnxPlan& plan, const OnnxGraph& graph, const OnnxNode& node)
    : plan_(plan), graph_(graph), node_(node) {}

void OnnxBuilder::refuse(const std::string& problem) const {
  throw InputError(fmt::format("'{}': node '{}', operator {}: {}", graph_.file, excerpt(node_.name), excerpt(node_.op),
                               excerpt(problem, kShownSentence)));
}

bool OnnxBuilder::has_input(int i) const { return i < input_count() && !node_.inputs[i].empty(); }

bool OnnxBuilder::has_output(int i) const { return i < output_count() && !node_.outputs[i].empty(); }

const OnnxValue& OnnxBuilder::input(int i) const {
  const auto found = plan_.values.find(node_.inputs[i]);
  if (found == plan_.values.end())
    refuse(fmt::format("expected input '{}' to be an earlier node's output, found none of that name", node_.inputs[i]));
  return found->second;
}

const OnnxValue& OnnxBuilder::float_input(int i) const {
  const OnnxValue& value = input(i);
  require(value.type == ElementType::kFloat, "input {}: expected floats, found whole numbers", i);
  return value;
}

const float* OnnxBuilder::data(const OnnxValue& value) {
  if (value.data != nullptr) return value.data;
  float* copy = memory(value.count());
  std::ranges::transform(value.integers, copy, [](std::int64_t number) { return static_cast<float>(number); });
  return copy;
}

const std::vector<std::int64_t>& OnnxBuilder::whole_numbers(int i) const {
  const OnnxValue& value = input(i);
  require(value.whole_constant(), "input {}: expected whole numbers that do not depend on the network's input", i);
  return value.integers;
}

const OnnxAttribute* OnnxBuilder::attribute(const std::string& name) const {
  const auto found = node_.attributes.find(name);
  return found == node_.attributes.end() ? nullptr : &found->second;
}

template <typename T>
const T* OnnxBuilder::typed(const std::string& name) const {
  const OnnxAttribute* found = attribute(name);
  if (found == nullptr) return nullptr;
  const T* value = std::get_if<T>(found);
  require(value != nullptr, "attribute '{}' is not of the expected type", name);
  return value;
}

std::int64_t OnnxBuilder::integer(const std::string& name, std::int64_t otherwise) const {
  const auto* value = typed<std::int64_t>(name);
  return value != nullptr ? *value : otherwise;
}

float OnnxBuilder::number(const std::string& name, float otherwise) const {
  const auto* value = typed<float>(name);
  if (value == nullptr) return otherwise;
  require(std::isfinite(*value), "attribute '{}': expected a finite number, found {}", name, *value);
  return *value;
}

std::string OnnxBuilder::text(const std::string& name, const std::string& otherwise) const {
  const auto* value = typed<std::string>(name);
  return value != nullptr ? *value : otherwise;
}

std::optional<std::vector<std::int64_t>> OnnxBuilder::integers(const std::string& name) const {
  const auto* value = typed<std::vector<std::int64_t>>(name);
  return value != nullptr ? std::optional(*value) : std::nullopt;
}

int OnnxBuilder::axis(std::int64_t axis, int rank) const {
  require(axis >= -rank && axis < rank, "expected an axis of a tensor of rank {}, found {}", rank, axis);
  return static_cast<int>(axis < 0 ? axis + rank : axis);
}

float* OnnxBuilder::memory(std::int64_t count) {
  float* taken = plan_.arena.take(count);
  require(taken != nullptr, "needs more than the {} numbers that a network may hold", OnnxArena::kLimit);
  return taken;
}

bool OnnxBuilder::inputs_are_constant() const {
  for (int i = 0; i < input_count(); ++i)
    if (has_input(i) && !input(i).constant) return false;
  return true;
}

void OnnxBuilder::define(int i, OnnxValue value) {
  if (!has_output(i)) return;
  require(plan_.values.emplace(node_.outputs[i], std::move(value)).second, "output '{}': the name is taken",
          node_.outputs[i]);
}

float* OnnxBuilder::output(int i, const Shape& shape, ElementType type) {
  OnnxValue value;
  value.type = type;
  value.shape = shape;
  value.constant = inputs_are_constant();
  value.data = memory(value.count());
  float* data = value.data;
  define(i, std::move(value));
  return data;
}

void OnnxBuilder::alias(int i, const OnnxValue& source, const Shape& shape, std::int64_t offset) {
  OnnxValue value = source;
  value.shape = shape;
  if (value.data != nullptr) value.data += offset;
  define(i, std::move(value));
}

void OnnxBuilder::whole_output(int i, const Shape& shape, std::vector<std::int64_t> values, ElementType type) {
  OnnxValue value;
  value.type = type;
  value.shape = shape;
  value.constant = true;
  value.integers = std::move(values);
  define(i, std::move(value));
}

void OnnxBuilder::step(OnnxStep step) {
  if (!inputs_are_constant()) {
    plan_.steps.push_back(std::move(step));
    return;
  }
  step();
  for (const std::string& name : node_.outputs) {
    const auto found = plan_.values.find(name);
    if (found == plan_.values.end() || found->second.type == ElementType::kFloat) continue;
    OnnxValue& value = found->second;  // what is constant and whole is kept as int64
    for (std::int64_t k = 0; k < value.count(); ++k)
      value.integers.push_back(std::abs(value.data[k]) <= kExactInFloat ? static_cast<std::int64_t>(value.data[k]) : 0);
    value.data = nullptr;
  }
}

std::unique_ptr<OnnxPlan> plan_onnx(const OnnxGraph& graph) {
  auto plan = std::make_unique<OnnxPlan>();
  for (const auto& [name, tensor] : graph.constants)
    plan->values.emplace(name, constant_value(*plan, tensor, graph.file));
  for (const OnnxPort& port : graph.inputs)
    if (!plan->values.emplace(port.name, input_value(*plan, port, graph.file)).second)
      throw InputError(fmt::format("'{}': input '{}' stands in the file twice", graph.file, excerpt(port.name)));
  for (const OnnxNode& node : graph.nodes) build(*plan, graph, node);
  for (const OnnxPort& port : graph.outputs)
    if (!plan->values.contains(port.name))
      throw InputError(fmt::format("'{}': output '{}': no node gives it", graph.file, excerpt(port.name)));
  return plan;
}

namespace {

class OnnxNetwork final : public Network {
 public:
  explicit OnnxNetwork(const OnnxGraph& graph) : plan_(plan_onnx(graph)) {
    for (const OnnxPort& port : graph.inputs) {
      OnnxValue& value = plan_->values.at(port.name);
      inputs_.push_back({port.name, static_cast<int>(value.count())});
      to_.push_back(value.data);
    }
    for (const OnnxPort& port : graph.outputs) add_output(graph, port);
    plan_->values.clear();  // the steps hold the addresses
  }

  [[nodiscard]] std::span<const Port> inputs() const override { return inputs_; }
  [[nodiscard]] std::span<const Port> outputs() const override { return outputs_; }

  void run(std::span<const std::span<const float>> inputs, std::span<const std::span<float>> outputs) override {
    for (std::size_t i = 0; i < to_.size(); ++i) std::copy_n(inputs[i].data(), inputs_[i].size, to_[i]);
    for (const OnnxStep& step : plan_->steps) step();
    for (std::size_t i = 0; i < from_.size(); ++i) std::copy_n(from_[i], outputs_[i].size, outputs[i].data());
  }

 private:
  void add_output(const OnnxGraph& graph, const OnnxPort& port) {
    const OnnxValue& value = plan_->values.at(port.name);
    check_shape(graph, port, value.shape);
    if (value.data == nullptr)
      throw InputError(fmt::format("'{}': output '{}': expected what the network gives, found fixed whole numbers",
                                   graph.file, port.name));
    outputs_.push_back({port.name, static_cast<int>(value.count())});
    from_.push_back(value.data);
  }

  // The shape that the file states for an output, where it states one, must be the one that its nodes give.
  static void check_shape(const OnnxGraph& graph, const OnnxPort& port, const Shape& found) {
    if (port.shape.empty()) return;
    bool fits = port.shape.size() == found.size();
    for (std::size_t d = 0; fits && d < found.size(); ++d) fits = port.shape[d] < 0 || port.shape[d] == found[d];
    if (!fits)
      throw InputError(fmt::format("'{}': output '{}': expected shape {} (-1: any), found {}", graph.file, port.name,
                                   shape_text(port.shape), shape_text(found)));
  }

  std::unique_ptr<OnnxPlan> plan_;
  std::vector<Port> inputs_, outputs_;
  std::vector<float*> to_;
  std::vector<const float*> from_;
};

}  // namespace

std::unique_ptr<Network> onnx_network(const OnnxGraph& graph) { return std::make_unique<OnnxNetwork>(graph); }

std::unique_ptr<Network> onnx_network(std::string_view bytes, const std::string& file, const std::string& folder) {
  return onnx_network(parse_onnx(bytes, file, folder));
}

}  // namespace duet
