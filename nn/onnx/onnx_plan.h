// How an ONNX graph becomes a list of steps over fixed memory: shapes are inferred with every open size 1, what depends
// on constants alone is computed once, and each remaining node is a closure with its pointers resolved. Float: this is
// a kernel room. Internal to nn/; operators are in nn/onnx_*.cpp, one table per file.
#pragma once

#include <fmt/core.h>

#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "duet/nn/network.h"
#include "duet/nn/onnx/onnx_model.h"

namespace duet {

// A tensor of the plan. Constant integers and booleans are kept as int64; whatever depends on the network's input is
// float, whole numbers (exact up to 2^24) and booleans (0, 1) too.
struct OnnxValue {
  ElementType type = ElementType::kFloat;
  Shape shape;
  bool constant = false;
  float* data = nullptr;               // count() floats; null for a constant that is not kFloat
  std::vector<std::int64_t> integers;  // of a constant that is not kFloat

  [[nodiscard]] std::int64_t count() const;
  [[nodiscard]] int rank() const { return static_cast<int>(shape.size()); }
  [[nodiscard]] bool whole_constant() const { return constant && type != ElementType::kFloat; }
};

std::int64_t count_of(const Shape& shape);
std::string shape_text(const Shape& shape);

// The most numbers in one value that is moved, broadcast or reduced: its order is kept as a list. Weights may be
// larger.
inline constexpr std::int64_t kMostOrdered = std::int64_t{1} << 22;

// Floats at addresses that stay: what all values of one network lie in. Freed with it.
class OnnxArena {
 public:
  // Null where the sum is beyond kLimit.
  float* take(std::int64_t count);

  static constexpr std::int64_t kLimit = std::int64_t{1} << 26;

 private:
  std::vector<std::vector<float>> blocks_;
  float* next_ = nullptr;
  std::int64_t room_ = 0, total_ = 0;  // floats left in the last block; handed out
};

using OnnxStep = std::function<void()>;

struct OnnxPlan {
  OnnxArena arena;
  std::map<std::string, OnnxValue> values;
  std::vector<OnnxStep> steps;
};

// One node while it is planned: what an operator's builder reads from and writes to. Every misfit is refused with file,
// node and operator.
class OnnxBuilder {
 public:
  OnnxBuilder(OnnxPlan& plan, const OnnxGraph& graph, const OnnxNode& node);

  [[noreturn]] void refuse(const std::string& problem) const;
  void require(bool condition, const std::string& problem) const {
    if (!condition) refuse(problem);
  }
  template <typename First, typename... Rest>
  void require(bool condition, fmt::format_string<First, Rest...> problem, First&& first, Rest&&... rest) const {
    if (!condition) refuse(fmt::vformat(problem, fmt::make_format_args(first, rest...)));
  }

  [[nodiscard]] int opset() const { return graph_.opset; }
  [[nodiscard]] const std::string& op() const { return node_.op; }
  [[nodiscard]] int input_count() const { return static_cast<int>(node_.inputs.size()); }
  [[nodiscard]] int output_count() const { return static_cast<int>(node_.outputs.size()); }
  [[nodiscard]] bool has_input(int i) const;
  [[nodiscard]] bool has_output(int i) const;
  [[nodiscard]] const OnnxValue& input(int i) const;
  // The value of a floating-point input, and of any other input as floats.
  [[nodiscard]] const OnnxValue& float_input(int i) const;
  const float* data(const OnnxValue& value);
  // The int64 that an input holds (shapes, axes): must be a constant.
  [[nodiscard]] const std::vector<std::int64_t>& whole_numbers(int i) const;

  [[nodiscard]] std::int64_t integer(const std::string& name, std::int64_t otherwise) const;
  [[nodiscard]] float number(const std::string& name, float otherwise) const;
  [[nodiscard]] std::string text(const std::string& name, const std::string& otherwise) const;
  [[nodiscard]] std::optional<std::vector<std::int64_t>> integers(const std::string& name) const;
  [[nodiscard]] const OnnxAttribute* attribute(const std::string& name) const;
  // An axis of a tensor of this rank, counted from the front; negative ones count from the back.
  [[nodiscard]] int axis(std::int64_t axis, int rank) const;

  // Memory for an output, filled by a step; and an output in another's memory, or known now. An output that nobody
  // asked for gets memory too.
  float* output(int i, const Shape& shape, ElementType type = ElementType::kFloat);
  void alias(int i, const OnnxValue& source, const Shape& shape, std::int64_t offset = 0);
  void whole_output(int i, const Shape& shape, std::vector<std::int64_t> values, ElementType type);
  float* memory(std::int64_t count);

  // Runs at every evaluation; or now, once, where all inputs are constants. At most one for a node.
  void step(OnnxStep step);

 private:
  template <typename T>
  [[nodiscard]] const T* typed(const std::string& name) const;
  void define(int i, OnnxValue value);
  [[nodiscard]] bool inputs_are_constant() const;

  OnnxPlan& plan_;
  const OnnxGraph& graph_;
  const OnnxNode& node_;
};

// Which of `rank` axes are among `axes`, each at most once.
std::vector<bool> marked_axes(const OnnxBuilder& builder, const std::vector<std::int64_t>& axes, int rank);

struct OnnxOperator {
  std::string_view name;
  int least_inputs, most_inputs, most_outputs;
  void (*build)(OnnxBuilder&);
};

// The tables of the operator files.
std::span<const OnnxOperator> elementwise_operators();
std::span<const OnnxOperator> movement_operators();
std::span<const OnnxOperator> shape_operators();
std::span<const OnnxOperator> linear_operators();
std::span<const OnnxOperator> reduction_operators();
std::span<const OnnxOperator> recurrent_operators();

// Throws InputError naming file, node and operator.
std::unique_ptr<OnnxPlan> plan_onnx(const OnnxGraph& graph);

// An ONNX model as a Network, evaluated by our own plan.

// `folder`: of files that the model keeps numbers in; "": it may have none. Throws InputError (see load_network).
std::unique_ptr<Network> onnx_network(std::string_view bytes, const std::string& file, const std::string& folder = "");
// A network from a graph that another format was read into.
std::unique_ptr<Network> onnx_network(const OnnxGraph& graph);

}  // namespace duet
