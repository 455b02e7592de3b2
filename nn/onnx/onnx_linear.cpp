// Operators that are sums of products: Gemm, MatMul, Conv (1-D). A matrix that is known at load is laid out for the
// dense kernels once; one that is not is multiplied by plain loops. Float: this is a kernel room.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numeric>

#include "duet/nn/dense_kernels.h"
#include "duet/nn/onnx/onnx_plan.h"
#include "duet/nn/onnx/onnx_shape.h"

namespace duet {
namespace {

// A matrix in memory, by its strides; row r, column c at r * row + c * col.
struct View {
  const float* data;
  std::int64_t row, col;
};

// rows x cols, row-major without gaps, times `factor`.
const float* packed(OnnxBuilder& builder, const View& from, std::int64_t rows, std::int64_t cols, float factor) {
  if (from.row == cols && from.col == 1 && factor == 1.0F) return from.data;
  float* to = builder.memory(rows * cols);
  for (std::int64_t r = 0; r < rows; ++r)
    for (std::int64_t c = 0; c < cols; ++c) to[r * cols + c] = factor * from.data[r * from.row + c * from.col];
  return to;
}

// y (m, n) = a (m, k) b (k, n), by plain loops in the order of memory.
void multiply(std::int64_t m, std::int64_t n, std::int64_t k, const View& a, const View& b, float* y) {
  std::fill_n(y, m * n, 0.0F);
  for (std::int64_t r = 0; r < m; ++r)
    for (std::int64_t i = 0; i < k; ++i) {
      const float factor = a.data[r * a.row + i * a.col];
      const float* row = b.data + i * b.row;
      for (std::int64_t c = 0; c < n; ++c) y[r * n + c] += factor * row[c * b.col];
    }
}

// y's rows are W x + bias for each row x of `x`.
OnnxStep rows_through(int rows, int outputs, int inputs, const float* W, const float* x, const float* bias, float* y) {
  const auto gemv = dense_kernels().gemv;
  return [=] {
    for (int r = 0; r < rows; ++r)
      gemv(outputs, inputs, W, x + static_cast<std::int64_t>(r) * inputs, bias,
           y + static_cast<std::int64_t>(r) * outputs);
  };
}

// beta C as one row of n numbers, where C is known at load and the same for every row; else null.
const float* bias_row(OnnxBuilder& builder, std::int64_t m, std::int64_t n, float beta) {
  const OnnxValue& C = builder.input(2);
  const Shape strides = broadcast_strides(C.shape, {m, n});
  if (!C.constant || (m > 1 && strides[0] != 0)) return nullptr;
  float* row = builder.memory(n);
  for (std::int64_t c = 0; c < n; ++c) row[c] = beta * C.data[c * strides[1]];
  return row;
}

struct GemmSizes {
  std::int64_t m, n, k;
  View a, b;
};

GemmSizes gemm_sizes(OnnxBuilder& builder) {
  const OnnxValue &A = builder.float_input(0), &B = builder.float_input(1);
  builder.require(A.rank() == 2 && B.rank() == 2, fmt::format("expected two matrices, found shapes {} and {}",
                                                              shape_text(A.shape), shape_text(B.shape)));
  const bool transpose_a = builder.integer("transA", 0) != 0, transpose_b = builder.integer("transB", 0) != 0;
  const std::int64_t m = A.shape[transpose_a ? 1 : 0], k = A.shape[transpose_a ? 0 : 1];
  const std::int64_t n = B.shape[transpose_b ? 0 : 1];
  builder.require(B.shape[transpose_b ? 1 : 0] == k,
                  fmt::format("shapes {} and {} do not fit together", shape_text(A.shape), shape_text(B.shape)));
  const View a = transpose_a ? View{A.data, 1, m} : View{A.data, k, 1};
  const View b = transpose_b ? View{B.data, 1, k} : View{B.data, n, 1};
  return {m, n, k, a, b};
}

// Whatever is not a constant matrix with rows of the input before it.
void general_gemm(OnnxBuilder& builder, const GemmSizes& s, float alpha, float beta) {
  const OnnxValue* C = builder.has_input(2) ? &builder.input(2) : nullptr;
  const Shape strides = C != nullptr ? broadcast_strides(C->shape, {s.m, s.n}) : Shape{0, 0};
  const float* c = C != nullptr ? C->data : nullptr;
  float* y = builder.output(0, {s.m, s.n});
  builder.step([=] {
    multiply(s.m, s.n, s.k, s.a, s.b, y);
    for (std::int64_t r = 0; r < s.m; ++r)
      for (std::int64_t k = 0; k < s.n; ++k) {
        float& value = y[r * s.n + k];
        value = alpha * value + (c != nullptr ? beta * c[r * strides[0] + k * strides[1]] : 0.0F);
      }
  });
}

void gemm(OnnxBuilder& builder) {
  const float alpha = builder.number("alpha", 1.0F), beta = builder.number("beta", 1.0F);
  const GemmSizes s = gemm_sizes(builder);
  const bool with_bias = builder.has_input(2);
  if (with_bias)
    builder.require(
        broadcast_shape(builder, builder.float_input(2).shape, {s.m, s.n}) == Shape{s.m, s.n},
        fmt::format("input 2: shape {} does not fit ({}, {})", shape_text(builder.input(2).shape), s.m, s.n));
  const float* bias = with_bias ? bias_row(builder, s.m, s.n, beta) : nullptr;
  const bool rows_lie_together = s.a.col == 1 || s.m == 1;
  if (!builder.input(1).constant || !rows_lie_together || (with_bias && bias == nullptr))
    return general_gemm(builder, s, alpha, beta);
  const float* W = packed(builder, {s.b.data, s.b.col, s.b.row}, s.n, s.k, alpha);
  float* y = builder.output(0, {s.m, s.n});
  builder.step(rows_through(static_cast<int>(s.m), static_cast<int>(s.n), static_cast<int>(s.k), W, s.a.data, bias, y));
}

// Shapes of MatMul's operands with the dimension that ONNX adds to a vector.
struct MatMulShapes {
  Shape a, b, stack, result;  // stack: what comes before the last two; result: without the added dimensions
};

MatMulShapes matmul_shapes(const OnnxBuilder& builder) {
  Shape a = builder.float_input(0).shape, b = builder.float_input(1).shape;
  builder.require(!a.empty() && !b.empty(), "expected vectors or matrices, found a number");
  const bool vector_a = a.size() == 1, vector_b = b.size() == 1;
  if (vector_a) a.insert(a.begin(), 1);
  if (vector_b) b.push_back(1);
  builder.require(a.back() == b[b.size() - 2],
                  fmt::format("shapes {} and {} do not fit together", shape_text(a), shape_text(b)));
  Shape stack = broadcast_shape(builder, Shape(a.begin(), a.end() - 2), Shape(b.begin(), b.end() - 2));
  Shape result = stack;
  if (!vector_a) result.push_back(a[a.size() - 2]);
  if (!vector_b) result.push_back(b.back());
  return {a, b, stack, result};
}

// One product for each matrix of the two stacks.
void stacked_matmul(OnnxBuilder& builder, const MatMulShapes& shapes) {
  const std::int64_t m = shapes.a[shapes.a.size() - 2], k = shapes.a.back(), n = shapes.b.back();
  // The stacks' own strides count matrices, so a loop over the stack gives the matrices' numbers.
  auto loop = broadcast_loop<2>(
      {Shape(shapes.a.begin(), shapes.a.end() - 2), Shape(shapes.b.begin(), shapes.b.end() - 2)}, shapes.stack);
  const float *a = builder.input(0).data, *b = builder.input(1).data;
  float* to = builder.output(0, shapes.result);
  builder.step([=, loop = std::move(loop)] {
    float* y = to;
    for (const auto& from : loop.from)
      for (std::int64_t i = 0; i < loop.inner; ++i, y += m * n)
        multiply(m, n, k, {a + (from[0] + i * loop.step[0]) * m * k, k, 1},
                 {b + (from[1] + i * loop.step[1]) * k * n, n, 1}, y);
  });
}

void matmul(OnnxBuilder& builder) {
  const MatMulShapes shapes = matmul_shapes(builder);
  builder.require(count_of(shapes.result) <= kMostOrdered, "gives too many numbers");
  if (!builder.input(1).constant || shapes.b.size() != 2) return stacked_matmul(builder, shapes);
  const std::int64_t k = shapes.b[0], n = shapes.b[1], rows = count_of(Shape(shapes.a.begin(), shapes.a.end() - 1));
  const float* W = packed(builder, {builder.input(1).data, 1, n}, n, k, 1.0F);
  float* y = builder.output(0, shapes.result);
  builder.step(rows_through(static_cast<int>(rows), static_cast<int>(n), static_cast<int>(k), W, builder.input(0).data,
                            nullptr, y));
}

struct Convolution {
  std::int64_t batch = 1, groups = 1, in = 1, out = 1;  // in, out: channels of one group
  std::int64_t length = 1, kernel = 1, stride = 1, dilation = 1, pad = 0, places = 1;
  const float *x = nullptr, *W = nullptr, *bias = nullptr;
  float *window = nullptr, *result = nullptr, *y = nullptr;
};

// Fills the window that the kernel sees at one place: (in, kernel), zeros beyond the ends.
void fill_window(const Convolution& c, const float* x, std::int64_t place) {
  const std::int64_t begin = place * c.stride - c.pad;
  float* to = c.window;
  for (std::int64_t i = 0; i < c.in; ++i)
    for (std::int64_t k = 0; k < c.kernel; ++k) {
      const std::int64_t at = begin + k * c.dilation;
      *to++ = at >= 0 && at < c.length ? x[i * c.length + at] : 0.0F;
    }
}

void run(const Convolution& c) {
  const auto gemv = dense_kernels().gemv;
  const int width = static_cast<int>(c.in * c.kernel);
  for (std::int64_t n = 0; n < c.batch; ++n)
    for (std::int64_t g = 0; g < c.groups; ++g)
      for (std::int64_t place = 0; place < c.places; ++place) {
        fill_window(c, c.x + (n * c.groups + g) * c.in * c.length, place);
        gemv(static_cast<int>(c.out), width, c.W + g * c.out * width, c.window,
             c.bias != nullptr ? c.bias + g * c.out : nullptr, c.result);
        float* y = c.y + (n * c.groups + g) * c.out * c.places + place;
        for (std::int64_t o = 0; o < c.out; ++o) y[o * c.places] = c.result[o];
      }
}

std::int64_t conv_number(const OnnxBuilder& builder, const char* name) {
  const auto numbers = builder.integers(name).value_or(std::vector<std::int64_t>{1});
  builder.require(numbers.size() == 1 && numbers[0] >= 1 && numbers[0] <= OnnxArena::kLimit,
                  fmt::format("attribute '{}': expected one number from 1", name));
  return numbers[0];
}

// Zeros before and after.
std::array<std::int64_t, 2> padding(const OnnxBuilder& builder, const Convolution& c) {
  const std::string automatic = builder.text("auto_pad", "NOTSET");
  if (automatic == "VALID") return {0, 0};
  if (automatic == "SAME_UPPER" || automatic == "SAME_LOWER") {
    const std::int64_t places = (c.length + c.stride - 1) / c.stride;
    const std::int64_t sum =
        std::max<std::int64_t>(0, (places - 1) * c.stride + (c.kernel - 1) * c.dilation + 1 - c.length);
    const std::int64_t small = sum / 2;
    return automatic == "SAME_UPPER" ? std::array{small, sum - small} : std::array{sum - small, small};
  }
  builder.require(automatic == "NOTSET", fmt::format("attribute 'auto_pad': unknown value '{}'", automatic));
  const auto pads = builder.integers("pads").value_or(std::vector<std::int64_t>{0, 0});
  builder.require(pads.size() == 2 &&
                      std::ranges::all_of(pads, [](std::int64_t pad) { return pad >= 0 && pad <= OnnxArena::kLimit; }),
                  "attribute 'pads': expected two numbers from 0");
  return {pads[0], pads[1]};
}

Convolution convolution(OnnxBuilder& builder) {
  const OnnxValue &x = builder.float_input(0), &W = builder.float_input(1);
  builder.require(x.rank() == 3 && W.rank() == 3, fmt::format("expected a 1-D convolution, found shapes {} and {}",
                                                              shape_text(x.shape), shape_text(W.shape)));
  Convolution c{.batch = x.shape[0], .groups = builder.integer("group", 1), .in = W.shape[1]};
  builder.require(
      c.groups >= 1 && c.groups <= W.shape[0] && W.shape[0] % c.groups == 0 && x.shape[1] == c.in * c.groups,
      fmt::format("shapes {} and {} do not fit together in {} groups", shape_text(x.shape), shape_text(W.shape),
                  c.groups));
  c.out = W.shape[0] / c.groups;
  c.length = x.shape[2];
  c.kernel = W.shape[2];
  c.stride = conv_number(builder, "strides");
  c.dilation = conv_number(builder, "dilations");
  const auto [before, after] = padding(builder, c);
  c.pad = before;
  const std::int64_t room = c.length + before + after - (c.kernel - 1) * c.dilation - 1;
  builder.require(c.kernel >= 1 && room >= 0, fmt::format("a kernel of {} does not fit into {}", c.kernel, c.length));
  c.places = room / c.stride + 1;
  c.x = x.data;
  c.W = W.data;
  return c;
}

void conv(OnnxBuilder& builder) {
  Convolution c = convolution(builder);
  if (builder.has_input(2)) {
    builder.require(
        builder.float_input(2).shape == Shape{c.out * c.groups},
        fmt::format("input 2: expected shape ({}), found {}", c.out * c.groups, shape_text(builder.input(2).shape)));
    c.bias = builder.input(2).data;
  }
  c.window = builder.memory(c.in * c.kernel);
  c.result = builder.memory(c.out);
  c.y = builder.output(0, {c.batch, c.out * c.groups, c.places});
  builder.step([c] { run(c); });
}

constexpr OnnxOperator kLinearOperators[] = {
    {"Conv", 2, 3, 1, conv},
    {"Gemm", 2, 3, 1, gemm},
    {"MatMul", 2, 2, 1, matmul},
};

}  // namespace

std::span<const OnnxOperator> linear_operators() { return kLinearOperators; }

// Operators that draw many numbers together: sums, means, norms, Softmax, LayerNormalization. Sums run in double.
// Float: this is a kernel room.

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
