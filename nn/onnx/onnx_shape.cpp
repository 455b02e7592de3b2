// Operators about shapes and kinds: they leave the numbers where they are, or put constants there. Nearly all of them
// cost nothing at run time.
#include "duet/nn/onnx/onnx_shape.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "duet/nn/onnx/onnx_plan.h"

namespace duet {

Shape broadcast_shape(const OnnxBuilder& builder, const Shape& a, const Shape& b) {
  Shape out(std::max(a.size(), b.size()), 1);
  for (std::size_t back = 1; back <= out.size(); ++back) {
    const std::int64_t size_a = back <= a.size() ? a[a.size() - back] : 1;
    const std::int64_t size_b = back <= b.size() ? b[b.size() - back] : 1;
    builder.require(size_a == size_b || size_a == 1 || size_b == 1,
                    fmt::format("shapes {} and {} do not fit together", shape_text(a), shape_text(b)));
    out[out.size() - back] = size_a == 1 ? size_b : size_a;
  }
  return out;
}

Shape strides_of(const Shape& shape) {
  Shape strides(shape.size(), 1);
  for (std::size_t d = shape.size(); d-- > 1;) strides[d - 1] = strides[d] * shape[d];
  return strides;
}

Shape broadcast_strides(const Shape& in, const Shape& out) {
  const Shape own = strides_of(in);
  Shape strides(out.size(), 0);
  for (std::size_t back = 1; back <= in.size(); ++back)
    if (in[in.size() - back] != 1) strides[out.size() - back] = own[in.size() - back];
  return strides;
}

std::vector<bool> marked_axes(const OnnxBuilder& builder, const std::vector<std::int64_t>& axes, int rank) {
  std::vector<bool> marks(rank, false);
  for (const std::int64_t axis : axes) {
    builder.require(!marks[builder.axis(axis, rank)], fmt::format("axis {} stands there twice", axis));
    marks[builder.axis(axis, rank)] = true;
  }
  return marks;
}

namespace {

void identity(OnnxBuilder& builder) { builder.alias(0, builder.input(0), builder.input(0).shape); }

void reshape(OnnxBuilder& builder) {
  const OnnxValue& source = builder.input(0);
  Shape shape = builder.whole_numbers(1);
  const bool zero_is_zero = builder.integer("allowzero", 0) != 0;
  int open = -1;
  for (int d = 0; d < static_cast<int>(shape.size()); ++d) {
    if (shape[d] == 0 && !zero_is_zero && d < source.rank()) shape[d] = source.shape[d];
    builder.require(shape[d] >= -1 && (shape[d] != -1 || open < 0), "expected sizes from 0 and one -1");
    if (shape[d] == -1) open = d;
  }
  if (open >= 0) {
    shape[open] = 1;
    const std::int64_t rest = count_of(shape);
    builder.require(rest > 0 && source.count() % rest == 0,
                    fmt::format("shape {} does not divide {}", shape_text(shape), shape_text(source.shape)));
    shape[open] = source.count() / rest;
  }
  builder.require(count_of(shape) == source.count(),
                  fmt::format("expected {} numbers, found shape {}", source.count(), shape_text(shape)));
  builder.alias(0, source, shape);
}

void flatten(OnnxBuilder& builder) {
  const OnnxValue& source = builder.input(0);
  const std::int64_t given = builder.integer("axis", 1);
  const auto axis = given == source.rank() ? source.rank() : builder.axis(given, source.rank());
  const std::int64_t rows = count_of(Shape(source.shape.begin(), source.shape.begin() + axis));
  const std::int64_t cols = count_of(Shape(source.shape.begin() + axis, source.shape.end()));
  builder.alias(0, source, {rows, cols});
}

// The axes of Squeeze and Unsqueeze: an attribute up to operator set 12, an input from 13.
std::optional<std::vector<std::int64_t>> given_axes(const OnnxBuilder& builder) {
  if (builder.opset() < 13) {
    builder.require(builder.input_count() == 1, "expected axes as an attribute up to operator set 12");
    return builder.integers("axes");
  }
  builder.require(builder.attribute("axes") == nullptr, "expected axes as an input from operator set 13");
  return builder.has_input(1) ? std::optional(builder.whole_numbers(1)) : std::nullopt;
}

void squeeze(OnnxBuilder& builder) {
  const OnnxValue& source = builder.input(0);
  const auto axes = given_axes(builder);
  const std::vector<bool> drop = marked_axes(builder, axes.value_or(std::vector<std::int64_t>{}), source.rank());
  Shape shape;
  for (int d = 0; d < source.rank(); ++d) {
    builder.require(!drop[d] || source.shape[d] == 1,
                    fmt::format("axis {}: expected size 1, found {}", d, shape_text(source.shape)));
    if (!drop[d] && (axes || source.shape[d] != 1)) shape.push_back(source.shape[d]);
  }
  builder.alias(0, source, shape);
}

void unsqueeze(OnnxBuilder& builder) {
  const OnnxValue& source = builder.input(0);
  const auto axes = given_axes(builder);
  builder.require(axes.has_value(), "expected axes, found none");
  const std::vector<bool> added = marked_axes(builder, *axes, source.rank() + static_cast<int>(axes->size()));
  Shape shape;
  for (std::size_t d = 0, from = 0; d < added.size(); ++d) shape.push_back(added[d] ? 1 : source.shape[from++]);
  builder.alias(0, source, shape);
}

void shape_of(OnnxBuilder& builder) {
  const Shape& shape = builder.input(0).shape;
  const auto rank = static_cast<std::int64_t>(shape.size());
  const auto place = [&](const char* name, std::int64_t otherwise) {
    const std::int64_t given = builder.opset() < 15 ? otherwise : builder.integer(name, otherwise);
    return std::clamp<std::int64_t>(given < 0 ? std::max(given, -rank) + rank : given, 0, rank);
  };
  const std::int64_t start = place("start", 0), end = std::max(start, place("end", rank));
  builder.whole_output(0, {end - start}, Shape(shape.begin() + start, shape.begin() + end), ElementType::kInteger);
}

// A tensor that stands in an attribute.
void put(OnnxBuilder& builder, const OnnxTensor& tensor) {
  if (tensor.type != ElementType::kFloat) return builder.whole_output(0, tensor.shape, tensor.integers, tensor.type);
  float* to = builder.output(0, tensor.shape);
  std::ranges::copy(tensor.floats, to);
}

void constant(OnnxBuilder& builder) {
  if (const auto* value = builder.attribute("value")) {
    const auto* tensor = std::get_if<OnnxTensor>(value);
    builder.require(tensor != nullptr, "attribute 'value': expected a tensor");
    return put(builder, *tensor);
  }
  OnnxTensor tensor;
  if (builder.attribute("value_float") != nullptr)
    tensor.floats = {builder.number("value_float", 0.0F)};
  else if (builder.attribute("value_int") != nullptr)
    tensor = {.type = ElementType::kInteger, .shape = {}, .floats = {}, .integers = {builder.integer("value_int", 0)}};
  else if (const auto integers = builder.integers("value_ints"))
    tensor = {.type = ElementType::kInteger,
              .shape = {static_cast<std::int64_t>(integers->size())},
              .floats = {},
              .integers = *integers};
  else
    builder.refuse("expected an attribute 'value', 'value_float', 'value_int' or 'value_ints', found none");
  put(builder, tensor);
}

void constant_of_shape(OnnxBuilder& builder) {
  const Shape& shape = builder.whole_numbers(0);
  for (const std::int64_t size : shape)
    builder.require(size >= 0, fmt::format("expected sizes from 0, found {}", size));
  builder.require(count_of(shape) <= kMostOrdered, fmt::format("gives too many numbers: {}", shape_text(shape)));
  OnnxTensor fill{.type = ElementType::kFloat, .shape = {1}, .floats = {0.0F}, .integers = {}};
  if (const auto* value = builder.attribute("value")) {
    const auto* tensor = std::get_if<OnnxTensor>(value);
    builder.require(tensor != nullptr && count_of(tensor->shape) == 1, "attribute 'value': expected one number");
    fill = *tensor;
  }
  const auto count = static_cast<std::size_t>(count_of(shape));
  fill.shape = shape;
  if (fill.type == ElementType::kFloat)
    fill.floats.resize(count, fill.floats[0]);
  else
    fill.integers.resize(count, fill.integers[0]);
  put(builder, fill);
}

ElementType cast_target(const OnnxBuilder& builder) {
  constexpr std::int64_t kFloat = 1, kInt32 = 6, kInt64 = 7, kBool = 9, kDouble = 11;  // onnx.TensorProto.DataType
  switch (const std::int64_t to = builder.integer("to", 0)) {
    case kFloat:
    case kDouble:
      return ElementType::kFloat;
    case kInt32:
    case kInt64:
      return ElementType::kInteger;
    case kBool:
      return ElementType::kBoolean;
    default:
      builder.refuse(fmt::format("expected a cast to FLOAT, DOUBLE, INT32, INT64 or BOOL, found type {}", to));
  }
}

void cast_whole(OnnxBuilder& builder, const OnnxValue& source, ElementType to) {
  if (to != ElementType::kFloat) {
    std::vector<std::int64_t> values = source.integers;
    if (to == ElementType::kBoolean)
      for (std::int64_t& value : values) value = value != 0 ? 1 : 0;
    return builder.whole_output(0, source.shape, values, to);
  }
  float* out = builder.output(0, source.shape);
  std::ranges::transform(source.integers, out, [](std::int64_t value) { return static_cast<float>(value); });
}

void cast(OnnxBuilder& builder) {
  const OnnxValue& source = builder.input(0);
  const ElementType to = cast_target(builder);
  if (source.whole_constant()) return cast_whole(builder, source, to);
  // Floats hold all types at run time: only a cast that loses something is work.
  if (to == source.type || to == ElementType::kFloat || source.type == ElementType::kBoolean) {
    OnnxValue renamed = source;
    renamed.type = to;
    return builder.alias(0, renamed, source.shape);
  }
  const bool truth = to == ElementType::kBoolean;
  float* out = builder.output(0, source.shape, to);
  builder.step([from = source.data, out, count = source.count(), truth] {
    for (std::int64_t k = 0; k < count; ++k) out[k] = truth ? (from[k] != 0.0F ? 1.0F : 0.0F) : std::trunc(from[k]);
  });
}

constexpr OnnxOperator kShapeOperators[] = {
    {"Cast", 1, 1, 1, cast},       {"Constant", 0, 0, 1, constant}, {"ConstantOfShape", 1, 1, 1, constant_of_shape},
    {"Flatten", 1, 1, 1, flatten}, {"Identity", 1, 1, 1, identity}, {"Reshape", 2, 2, 1, reshape},
    {"Shape", 1, 1, 1, shape_of},  {"Squeeze", 1, 2, 1, squeeze},   {"Unsqueeze", 1, 2, 1, unsqueeze},
};

}  // namespace

std::span<const OnnxOperator> shape_operators() { return kShapeOperators; }

}  // namespace duet
