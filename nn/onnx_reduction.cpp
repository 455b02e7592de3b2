// Operators that draw many numbers together: sums, means, norms, Softmax, LayerNormalization. Sums run in double.
// Float: this is a kernel room.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numeric>

#include "duet/nn/onnx_broadcast.h"
#include "duet/nn/onnx_plan.h"

namespace duet {
namespace {

// Each result draws together the numbers at `starts[result] + offsets[.]`.
struct Groups {
  Shape shape;  // of the result
  std::vector<std::int64_t> starts = {0}, offsets = {0};
};

void extend(std::vector<std::int64_t>& places, std::int64_t size, std::int64_t stride) {
  std::vector<std::int64_t> next;
  next.reserve(places.size() * static_cast<std::size_t>(size));
  for (const std::int64_t place : places)
    for (std::int64_t k = 0; k < size; ++k) next.push_back(place + k * stride);
  places = std::move(next);
}

// An attribute; an input of ReduceSum from operator set 13 and of the others from 18.
std::vector<std::int64_t> reduced_axes(const OnnxBuilder& builder, int rank) {
  const bool as_input = builder.opset() >= (builder.op() == "ReduceSum" ? 13 : 18);
  builder.require(as_input || builder.input_count() == 1, "expected axes as an attribute in this operator set");
  builder.require(!as_input || builder.attribute("axes") == nullptr, "expected axes as an input in this operator set");
  std::vector<std::int64_t> axes;
  if (as_input && builder.has_input(1))
    axes = builder.whole_numbers(1);
  else if (!as_input)
    axes = builder.integers("axes").value_or(axes);
  if (axes.empty() && builder.integer("noop_with_empty_axes", 0) == 0) {
    axes.resize(rank);
    std::iota(axes.begin(), axes.end(), 0);
  }
  // Without axes it is said to leave its input as it is; whether its squares and roots are taken nobody agrees on.
  builder.require(!axes.empty() || rank == 0 || builder.op() == "ReduceSum" || builder.op() == "ReduceMean",
                  "attribute 'noop_with_empty_axes' without axes is not supported");
  for (std::int64_t& axis : axes) axis = builder.axis(axis, rank);
  return axes;
}

Groups groups(const OnnxBuilder& builder, const Shape& shape) {
  const std::vector<std::int64_t> axes = reduced_axes(builder, static_cast<int>(shape.size()));
  const bool keep = builder.integer("keepdims", 1) != 0;
  builder.require(count_of(shape) <= kMostOrdered, fmt::format("is given too many numbers: {}", shape_text(shape)));
  const Shape strides = strides_of(shape);
  Groups groups;
  for (std::size_t d = 0; d < shape.size(); ++d) {
    const bool reduced = std::ranges::find(axes, static_cast<std::int64_t>(d)) != axes.end();
    extend(reduced ? groups.offsets : groups.starts, shape[d], strides[d]);
    if (!reduced || keep) groups.shape.push_back(reduced ? 1 : shape[d]);
  }
  return groups;
}

// The result is end(the sum of all add(x), their number).
template <double (*kAdd)(double sum, float x), double (*kEnd)(double sum, double count)>
void reduce(OnnxBuilder& builder) {
  const OnnxValue& source = builder.float_input(0);
  Groups of = groups(builder, source.shape);
  builder.require(!of.offsets.empty(), "draws no numbers together");
  float* to = builder.output(0, of.shape);
  builder.step([from = source.data, of = std::move(of), to] {
    for (std::size_t k = 0; k < of.starts.size(); ++k) {
      const float* start = from + of.starts[k];
      double sum = 0.0;
      for (const std::int64_t offset : of.offsets) sum = kAdd(sum, start[offset]);
      to[k] = static_cast<float>(kEnd(sum, static_cast<double>(of.offsets.size())));
    }
  });
}

double add(double sum, float x) { return sum + static_cast<double>(x); }
double add_square(double sum, float x) { return sum + static_cast<double>(x) * static_cast<double>(x); }
double whole(double sum, double /*count*/) { return sum; }
double mean(double sum, double count) { return sum / count; }
double root(double sum, double /*count*/) { return std::sqrt(sum); }

// Numbers `stride` apart that belong together: `count` of them, in `outer` blocks of `stride` groups each.
struct Lines {
  std::int64_t outer = 1, count = 1, stride = 1;
};

// Up to operator set 12 all dimensions from the axis on belong together, from 13 the axis alone does.
Lines softmax_lines(const OnnxBuilder& builder, const Shape& shape) {
  const bool from_axis_on = builder.opset() < 13;
  const int axis = builder.axis(builder.integer("axis", from_axis_on ? 1 : -1), static_cast<int>(shape.size()));
  Lines lines;
  for (int d = 0; d < static_cast<int>(shape.size()); ++d) {
    if (d < axis)
      lines.outer *= shape[d];
    else if (d == axis || from_axis_on)
      lines.count *= shape[d];
    else
      lines.stride *= shape[d];
  }
  return lines;
}

void softmax_line(const float* x, float* y, std::int64_t count, std::int64_t stride) {
  float most = x[0];
  for (std::int64_t k = 1; k < count; ++k) most = std::max(most, x[k * stride]);
  double sum = 0.0;
  for (std::int64_t k = 0; k < count; ++k) {
    y[k * stride] = std::exp(x[k * stride] - most);
    sum += static_cast<double>(y[k * stride]);
  }
  const auto scale = static_cast<float>(1.0 / sum);
  for (std::int64_t k = 0; k < count; ++k) y[k * stride] *= scale;
}

void softmax(OnnxBuilder& builder) {
  const OnnxValue& source = builder.float_input(0);
  const Lines lines = softmax_lines(builder, source.shape);
  float* to = builder.output(0, source.shape);
  builder.step([from = source.data, to, lines] {
    if (lines.count == 0) return;
    for (std::int64_t o = 0; o < lines.outer; ++o)
      for (std::int64_t s = 0; s < lines.stride; ++s) {
        const std::int64_t at = o * lines.count * lines.stride + s;
        softmax_line(from + at, to + at, lines.count, lines.stride);
      }
  });
}

void normalise(const float* x, const float* scale, const float* shift, float epsilon, std::int64_t count, float* y) {
  double sum = 0.0, squares = 0.0;
  for (std::int64_t k = 0; k < count; ++k) sum += static_cast<double>(x[k]);
  const double mean = sum / static_cast<double>(count);
  for (std::int64_t k = 0; k < count; ++k) {
    const double distance = static_cast<double>(x[k]) - mean;
    squares += distance * distance;
  }
  const double factor = 1.0 / std::sqrt(squares / static_cast<double>(count) + static_cast<double>(epsilon));
  for (std::int64_t k = 0; k < count; ++k) {
    const auto normal = static_cast<float>((static_cast<double>(x[k]) - mean) * factor);
    y[k] = normal * scale[k] + (shift != nullptr ? shift[k] : 0.0F);
  }
}

// Over the axis and all after it; the mean and deviation that it may also give are refused.
void layer_normalization(OnnxBuilder& builder) {
  builder.require(builder.opset() >= 17, fmt::format("expected operator set 17, found {}", builder.opset()));
  const OnnxValue& source = builder.float_input(0);
  const int axis = builder.axis(builder.integer("axis", -1), source.rank());
  const std::int64_t count = count_of(Shape(source.shape.begin() + axis, source.shape.end()));
  const float* factors[2] = {nullptr, nullptr};
  for (const int i : {1, 2}) {
    if (!builder.has_input(i)) continue;
    builder.require(
        builder.float_input(i).count() == count,
        fmt::format("input {}: expected {} numbers, found shape {}", i, count, shape_text(builder.input(i).shape)));
    factors[i - 1] = builder.input(i).data;
  }
  builder.require(count > 0, "normalises no numbers");
  float* to = builder.output(0, source.shape);
  builder.step([=, from = source.data, scale = factors[0], shift = factors[1], rows = source.count() / count,
                epsilon = builder.number("epsilon", 1e-5F)] {
    for (std::int64_t r = 0; r < rows; ++r) normalise(from + r * count, scale, shift, epsilon, count, to + r * count);
  });
}

constexpr OnnxOperator kReductionOperators[] = {
    {"LayerNormalization", 2, 3, 1, layer_normalization},
    {"ReduceL2", 1, 2, 1, reduce<add_square, root>},
    {"ReduceMean", 1, 2, 1, reduce<add, mean>},
    {"ReduceSum", 1, 2, 1, reduce<add, whole>},
    {"ReduceSumSquare", 1, 2, 1, reduce<add_square, whole>},
    {"Softmax", 1, 1, 1, softmax},
};

}  // namespace

std::span<const OnnxOperator> reduction_operators() { return kReductionOperators; }

}  // namespace duet
