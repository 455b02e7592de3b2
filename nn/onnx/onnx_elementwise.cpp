// Operators that treat each number by itself, with broadcasting. A number that is not finite comes out as one, but for
// Relu, Clip, Min and Max, which may bound an infinity. Float: this is a kernel room.
#include <fmt/format.h>

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <limits>

#include "duet/nn/dense_kernels.h"
#include "duet/nn/onnx/onnx_plan.h"
#include "duet/nn/onnx/onnx_shape.h"

namespace duet {
namespace {

using Array = Eigen::Array<float, Eigen::Dynamic, 1>;
using In = Eigen::Map<const Array>;
using Out = Eigen::Map<Array>;

using UnaryKernel = void (*)(const In& x, Out y, float parameter);

// y = kernel(x); `parameter` is a number fixed at load.
void unary(OnnxBuilder& builder, UnaryKernel kernel, float parameter = 0.0F) {
  const OnnxValue& source = builder.input(0);
  builder.require(source.type != ElementType::kBoolean, "expected numbers, found truth values");
  const float* from = builder.data(source);
  float* to = builder.output(0, source.shape, source.type);
  builder.step([=, count = source.count()] { kernel(In(from, count), Out(to, count), parameter); });
}

// A unary operator for floats alone.
void smooth(OnnxBuilder& builder, UnaryKernel kernel, float parameter = 0.0F) {
  (void)builder.float_input(0);
  unary(builder, kernel, parameter);
}

template <float (*kFunction)(float)>
void each(const In& x, Out y, float /*parameter*/) {
  for (Eigen::Index i = 0; i < x.size(); ++i) y[i] = kFunction(x[i]);
}

float softplus(float x) { return std::isnan(x) ? x : std::max(x, 0.0F) + std::log1p(std::exp(-std::abs(x))); }
float error_function(float x) { return std::erf(x); }
float exponential_of(float x) { return std::exp(x); }
float logarithm(float x) { return std::log(x); }
float sine(float x) { return std::sin(x); }
float cosine(float x) { return std::cos(x); }

template <float (*kFunction)(float)>
void build_each(OnnxBuilder& builder) {
  smooth(builder, each<kFunction>);
}

// Eigen's vectorised exp saturates instead of giving an infinity; 1 / (1 + exp(-x)) is 0 or 1 to float's precision
// there.
void sigmoid(OnnxBuilder& builder) {
  smooth(builder, [](const In& x, Out y, float) { y = ((-x).exp() + 1.0F).inverse(); });
}
void hyperbolic_tangent(OnnxBuilder& builder) {
  smooth(builder, [](const In& x, Out y, float) { y = x.tanh(); });
}
void exponential(OnnxBuilder& builder) { build_each<exponential_of>(builder); }
void square_root(OnnxBuilder& builder) {
  smooth(builder, [](const In& x, Out y, float) { y = x.sqrt(); });
}
void reciprocal(OnnxBuilder& builder) {
  smooth(builder, [](const In& x, Out y, float) { y = x.inverse(); });
}
void negative(OnnxBuilder& builder) {
  unary(builder, [](const In& x, Out y, float) { y = -x; });
}
void absolute(OnnxBuilder& builder) {
  unary(builder, [](const In& x, Out y, float) { y = x.abs(); });
}
void relu(OnnxBuilder& builder) {
  unary(builder, [](const In& x, Out y, float) { y = (x < 0.0F).select(0.0F, x); });
}
void leaky_relu(OnnxBuilder& builder) {
  smooth(
      builder, [](const In& x, Out y, float slope) { y = (x < 0.0F).select(slope * x, x); },
      builder.number("alpha", 0.01F));
}

void elu(OnnxBuilder& builder) {
  const float alpha = builder.number("alpha", 1.0F);
  if (alpha == 1.0F)
    smooth(builder, [](const In& x, Out y, float) {
      y = x;
      dense_kernels().elu(static_cast<int>(y.size()), y.data());
    });
  else
    smooth(
        builder,
        [](const In& x, Out y, float factor) {
          for (Eigen::Index i = 0; i < x.size(); ++i) y[i] = x[i] > 0.0F ? x[i] : factor * std::expm1(x[i]);
        },
        alpha);
}

void logical_not(OnnxBuilder& builder) {
  const OnnxValue& source = builder.input(0);
  builder.require(source.type == ElementType::kBoolean, "expected truth values, found numbers");
  const float* from = builder.data(source);
  float* to = builder.output(0, source.shape, ElementType::kBoolean);
  builder.step([=, count = source.count()] { Out(to, count) = 1.0F - In(from, count); });
}

// Clip's bounds are single numbers; they may be infinite, and one that is left out binds nothing. NaN stays NaN.
void clip(OnnxBuilder& builder) {
  const OnnxValue& source = builder.input(0);
  const float infinity = std::numeric_limits<float>::infinity();
  const auto bound = [&](int i, float none) {
    if (!builder.has_input(i)) {
      float* own = builder.memory(1);
      *own = none;
      return static_cast<const float*>(own);
    }
    builder.require(builder.input(i).count() == 1, fmt::format("input {}: expected one number", i));
    return builder.data(builder.input(i));
  };
  const float *low = bound(1, -infinity), *high = bound(2, infinity), *from = builder.data(source);
  float* to = builder.output(0, source.shape, source.type);
  builder.step([=, count = source.count()] {
    const float least = *low, most = *high;
    for (std::int64_t i = 0; i < count; ++i) {
      const float x = from[i] < least ? least : from[i];
      to[i] = x > most ? most : x;
    }
  });
}

// One operator of two operands, on floats and, for what is known at load, on int64.
template <typename F>
void run_binary(const BroadcastLoop<2>& loop, const float* a, const float* b, float* y, const F& f) {
  const auto [step_a, step_b] = loop.step;
  for (const auto& from : loop.from) {
    const float *p = a + from[0], *q = b + from[1];
    if (step_a == 1 && step_b == 1)
      for (std::int64_t i = 0; i < loop.inner; ++i) y[i] = f(p[i], q[i]);
    else if (step_a == 1 && step_b == 0)
      for (std::int64_t i = 0; i < loop.inner; ++i) y[i] = f(p[i], *q);
    else
      for (std::int64_t i = 0; i < loop.inner; ++i) y[i] = f(p[i * step_a], q[i * step_b]);
    y += loop.inner;
  }
}

struct Operands {
  const OnnxValue &a, &b;
  Shape shape;
};

Shape result_shape(const OnnxBuilder& builder, const Shape& a, const Shape& b) {
  Shape shape = broadcast_shape(builder, a, b);
  builder.require(count_of(shape) <= kMostOrdered, fmt::format("gives too many numbers: {}", shape_text(shape)));
  return shape;
}

Operands operands(OnnxBuilder& builder) {
  const OnnxValue &a = builder.input(0), &b = builder.input(1);
  builder.require(a.type == b.type, "expected operands of one type, found two");
  return {a, b, result_shape(builder, a.shape, b.shape)};
}

template <typename F>
void binary(OnnxBuilder& builder, const Operands& of, ElementType result, F f) {
  auto loop = broadcast_loop<2>({of.a.shape, of.b.shape}, of.shape);
  const float *a = builder.data(of.a), *b = builder.data(of.b);
  float* y = builder.output(0, of.shape, result);
  builder.step([loop = std::move(loop), a, b, y, f] { run_binary(loop, a, b, y, f); });
}

template <typename F>
void whole_binary(OnnxBuilder& builder, const Operands& of, ElementType result, F f) {
  const auto loop = broadcast_loop<2>({of.a.shape, of.b.shape}, of.shape);
  std::vector<std::int64_t> values;
  for (const auto& from : loop.from)
    for (std::int64_t i = 0; i < loop.inner; ++i)
      values.push_back(f(of.a.integers[from[0] + i * loop.step[0]], of.b.integers[from[1] + i * loop.step[1]]));
  builder.whole_output(0, of.shape, values, result);
}

// Sums of int64 wrap, as on every machine that runs these networks.
std::int64_t wrapped(std::uint64_t value) { return static_cast<std::int64_t>(value); }

// `f` for floats, `g` for int64; at run time whole numbers are floats too.
template <typename F, typename G>
void arithmetic(OnnxBuilder& builder, F f, G g) {
  const Operands of = operands(builder);
  builder.require(of.a.type != ElementType::kBoolean, "expected numbers, found truth values");
  if (of.a.whole_constant() && of.b.whole_constant())
    whole_binary(builder, of, of.a.type, g);
  else
    binary(builder, of, of.a.type, f);
}

void add(OnnxBuilder& builder) {
  arithmetic(
      builder, [](float a, float b) { return a + b; }, [](std::uint64_t a, std::uint64_t b) { return wrapped(a + b); });
}
void subtract(OnnxBuilder& builder) {
  arithmetic(
      builder, [](float a, float b) { return a - b; }, [](std::uint64_t a, std::uint64_t b) { return wrapped(a - b); });
}
void multiply(OnnxBuilder& builder) {
  arithmetic(
      builder, [](float a, float b) { return a * b; }, [](std::uint64_t a, std::uint64_t b) { return wrapped(a * b); });
}

void divide(OnnxBuilder& builder) {
  const Operands of = operands(builder);
  builder.require(of.a.type != ElementType::kBoolean, "expected numbers, found truth values");
  if (of.a.type == ElementType::kFloat) return binary(builder, of, of.a.type, [](float a, float b) { return a / b; });
  if (!of.a.constant || !of.b.constant)
    return binary(builder, of, of.a.type, [](float a, float b) { return std::trunc(a / b); });
  builder.require(std::ranges::find(of.b.integers, 0) == of.b.integers.end(), "divides a whole number by 0");
  whole_binary(builder, of, of.a.type, [](std::int64_t a, std::int64_t b) {
    return b == -1 ? wrapped(0 - static_cast<std::uint64_t>(a)) : a / b;
  });
}

// The base decides the type of the result; the square, which normalisations are made of, is a product.
void power(OnnxBuilder& builder) {
  (void)builder.float_input(0);
  const OnnxValue &a = builder.input(0), &b = builder.input(1);
  const Operands of{a, b, result_shape(builder, a.shape, b.shape)};
  const float* exponent = builder.data(b);
  if (b.constant && b.count() == 1 && *exponent == 2.0F)
    binary(builder, of, a.type, [](float x, float) { return x * x; });
  else
    binary(builder, of, a.type, [](float x, float y) { return std::pow(x, y); });
}

void equal(OnnxBuilder& builder) {
  const Operands of = operands(builder);
  if (of.a.whole_constant() && of.b.whole_constant())
    whole_binary(builder, of, ElementType::kBoolean, [](std::int64_t a, std::int64_t b) { return a == b ? 1 : 0; });
  else
    binary(builder, of, ElementType::kBoolean, [](float a, float b) { return a == b ? 1.0F : 0.0F; });
}

template <typename F>
void compare(OnnxBuilder& builder, F f) {
  const Operands of = operands(builder);
  builder.require(of.a.type != ElementType::kBoolean, "expected numbers, found truth values");
  binary(builder, of, ElementType::kBoolean, [f](float a, float b) { return f(a, b) ? 1.0F : 0.0F; });
}
void less(OnnxBuilder& builder) {
  compare(builder, [](float a, float b) { return a < b; });
}
void greater(OnnxBuilder& builder) {
  compare(builder, [](float a, float b) { return a > b; });
}
void less_or_equal(OnnxBuilder& builder) {
  compare(builder, [](float a, float b) { return a <= b; });
}
void greater_or_equal(OnnxBuilder& builder) {
  compare(builder, [](float a, float b) { return a >= b; });
}

// Min and Max of two operands, NaN where either is.
void extreme(OnnxBuilder& builder, bool greatest) {
  if (builder.input_count() == 1) return builder.alias(0, builder.input(0), builder.input(0).shape);
  if (greatest)
    arithmetic(
        builder, [](float a, float b) { return a > b || std::isnan(a) ? a : b; },
        [](std::int64_t a, std::int64_t b) { return std::max(a, b); });
  else
    arithmetic(
        builder, [](float a, float b) { return a < b || std::isnan(a) ? a : b; },
        [](std::int64_t a, std::int64_t b) { return std::min(a, b); });
}
void least(OnnxBuilder& builder) { extreme(builder, false); }
void greatest(OnnxBuilder& builder) { extreme(builder, true); }

// Where on int64 numbers known at load, as shapes are put together with it.
void where_whole(OnnxBuilder& builder, const BroadcastLoop<3>& loop, const Shape& shape) {
  std::vector<std::int64_t> values;
  for (const auto& from : loop.from)
    for (std::int64_t i = 0; i < loop.inner; ++i) {
      const auto at = [&](int n) { return builder.input(n).integers[from[n] + i * loop.step[n]]; };
      values.push_back(at(0) != 0 ? at(1) : at(2));
    }
  builder.whole_output(0, shape, values, builder.input(1).type);
}

void where(OnnxBuilder& builder) {
  const OnnxValue &condition = builder.input(0), &a = builder.input(1), &b = builder.input(2);
  builder.require(condition.type == ElementType::kBoolean, "input 0: expected truth values, found numbers");
  builder.require(a.type == b.type, "expected operands of one type, found two");
  const Shape shape = result_shape(builder, condition.shape, result_shape(builder, a.shape, b.shape));
  auto loop = broadcast_loop<3>({condition.shape, a.shape, b.shape}, shape);
  if (condition.whole_constant() && a.whole_constant() && b.whole_constant()) return where_whole(builder, loop, shape);
  const float *c = builder.data(condition), *p = builder.data(a), *q = builder.data(b);
  float* to = builder.output(0, shape, a.type);
  builder.step([loop = std::move(loop), c, p, q, to] {
    float* y = to;
    for (const auto& from : loop.from)
      for (std::int64_t i = 0; i < loop.inner; ++i)
        *y++ = c[from[0] + i * loop.step[0]] != 0.0F ? p[from[1] + i * loop.step[1]] : q[from[2] + i * loop.step[2]];
  });
}

constexpr OnnxOperator kElementwiseOperators[] = {
    {"Abs", 1, 1, 1, absolute},
    {"Add", 2, 2, 1, add},
    {"Clip", 1, 3, 1, clip},
    {"Cos", 1, 1, 1, build_each<cosine>},
    {"Div", 2, 2, 1, divide},
    {"Elu", 1, 1, 1, elu},
    {"Equal", 2, 2, 1, equal},
    {"Erf", 1, 1, 1, build_each<error_function>},
    {"Exp", 1, 1, 1, exponential},
    {"Greater", 2, 2, 1, greater},
    {"GreaterOrEqual", 2, 2, 1, greater_or_equal},
    {"LeakyRelu", 1, 1, 1, leaky_relu},
    {"Less", 2, 2, 1, less},
    {"LessOrEqual", 2, 2, 1, less_or_equal},
    {"Log", 1, 1, 1, build_each<logarithm>},
    {"Max", 1, 2, 1, greatest},
    {"Min", 1, 2, 1, least},
    {"Mul", 2, 2, 1, multiply},
    {"Neg", 1, 1, 1, negative},
    {"Not", 1, 1, 1, logical_not},
    {"Pow", 2, 2, 1, power},
    {"Reciprocal", 1, 1, 1, reciprocal},
    {"Relu", 1, 1, 1, relu},
    {"Sigmoid", 1, 1, 1, sigmoid},
    {"Sin", 1, 1, 1, build_each<sine>},
    {"Softplus", 1, 1, 1, build_each<softplus>},
    {"Sqrt", 1, 1, 1, square_root},
    {"Sub", 2, 2, 1, subtract},
    {"Tanh", 1, 1, 1, hyperbolic_tangent},
    {"Where", 3, 3, 1, where},
};

}  // namespace

std::span<const OnnxOperator> elementwise_operators() { return kElementwiseOperators; }

}  // namespace duet
