#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>

#include "tests/nn/evaluate.h"
#include "tests/nn/onnx_writer.h"
#include "tests/support.h"

namespace duet::test {
namespace {

using ::testing::ElementsAre;

std::vector<double> mapped(const Operand& x, const std::function<double(double)>& f) {
  std::vector<double> y;
  for (const float value : x.values) y.push_back(f(static_cast<double>(value)));
  return y;
}

double sigmoid(double x) { return 1.0 / (1.0 + std::exp(-x)); }

TEST(OnnxElementwise, UnaryOperatorsAreTheirClosedForms) {
  const Operand x = operand({3, 7}, 0, 6.0);
  const std::vector<std::pair<std::string, std::function<double(double)>>> operators = {
      {"Abs", [](double v) { return std::abs(v); }},
      {"Cos", [](double v) { return std::cos(v); }},
      {"Elu", [](double v) { return v > 0 ? v : std::expm1(v); }},
      {"Erf", [](double v) { return std::erf(v); }},
      {"Exp", [](double v) { return std::exp(v); }},
      {"LeakyRelu", [](double v) { return v > 0 ? v : 0.01 * v; }},
      {"Neg", [](double v) { return -v; }},
      {"Reciprocal", [](double v) { return 1.0 / v; }},
      {"Relu", [](double v) { return std::max(v, 0.0); }},
      {"Sigmoid", sigmoid},
      {"Sin", [](double v) { return std::sin(v); }},
      {"Softplus", [](double v) { return std::log1p(std::exp(v)); }},
      {"Tanh", [](double v) { return std::tanh(v); }},
      {"Identity", [](double v) { return v; }},
  };
  for (const auto& [op, f] : operators) expect_node(op, {x}, mapped(x, f));
  Operand positive = x;
  for (float& value : positive.values) value = std::abs(value);
  expect_node("Sqrt", {positive}, mapped(positive, [](double v) { return std::sqrt(v); }));
  expect_node("Log", {positive}, mapped(positive, [](double v) { return std::log(v); }));
}

TEST(OnnxElementwise, EluAndLeakyReluHonourAlpha) {
  const Operand x = operand({5}, 1, 3.0);
  expect_node("Elu", {x}, mapped(x, [](double v) { return v > 0 ? v : 0.5 * std::expm1(v); }), {{"alpha", 0.5F}});
  expect_node("LeakyRelu", {x}, mapped(x, [](double v) { return v > 0 ? v : 0.25 * v; }), {{"alpha", 0.25F}});
}

TEST(OnnxElementwise, SaturationIsExact) {
  const Operand far{{4}, {-200.0F, -90.0F, 90.0F, 200.0F}};
  expect_node("Sigmoid", {far}, {0, 0, 1, 1});
  expect_node("Tanh", {far}, {-1, -1, 1, 1});
  expect_node("Elu", {far}, {-1, -1, 90, 200});
  expect_node("Softplus", {far}, {0, 0, 90, 200});
}

TEST(OnnxElementwise, NanComesOutAsNan) {
  const float nan = std::nanf("");
  for (const char* op : {"Abs", "Elu", "Erf", "Exp", "LeakyRelu", "Neg", "Relu", "Sigmoid", "Softplus", "Sqrt", "Tanh",
                         "Clip", "Softmax", "ReduceMean", "Min", "Max"})
    for (const int size : {1, 4, 9}) {
      const Operand x{{1, size}, std::vector<float>(size, nan)};
      for (const float value : through(op, {x}, {}, 13, 0)) EXPECT_TRUE(std::isnan(value)) << op << " of " << size;
    }
  const Operand x{{2}, {nan, 1.0F}}, y{{2}, {1.0F, nan}};
  for (const char* op : {"Add", "Sub", "Mul", "Div", "Min", "Max", "Pow"})
    for (const float value : through(op, {x, y}, {}, 13, 0)) {
      // 1 ^ NaN is 1 by IEEE 754.
      EXPECT_TRUE(std::isnan(value) || (std::string(op) == "Pow" && value == 1.0F)) << op;
    }
}

// Element `k` of the result's shape in an operand.
float at(const Operand& x, const Shape& shape, std::int64_t k) {
  std::int64_t place = 0, stride = 1;
  for (std::size_t back = 1; back <= shape.size(); ++back) {
    const std::int64_t size = shape[shape.size() - back], index = k % size;
    k /= size;
    if (back > x.shape.size()) continue;
    const std::int64_t own = x.shape[x.shape.size() - back];
    place += (own == 1 ? 0 : index) * stride;
    stride *= own;
  }
  return x.values[place];
}

Shape joined(const Shape& a, const Shape& b) {
  Shape shape(std::max(a.size(), b.size()), 1);
  for (const Shape& part : {a, b})
    for (std::size_t back = 1; back <= part.size(); ++back)
      shape[shape.size() - back] = std::max(shape[shape.size() - back], part[part.size() - back]);
  return shape;
}

void expect_binary(const std::string& op, const Shape& a, const Shape& b,
                   const std::function<double(double, double)>& f) {
  Operand x = operand(a, 0, 2.0), y = operand(b, 1, 2.0);
  if (op == "Pow")
    for (float& value : x.values) value = std::abs(value);
  const Shape shape = joined(a, b);
  std::int64_t count = 1;
  for (const std::int64_t size : shape) count *= size;
  std::vector<double> expected;
  for (std::int64_t k = 0; k < count; ++k) expected.push_back(f(at(x, shape, k), at(y, shape, k)));
  expect_node(op, {x, y}, expected, {}, {13});
}

TEST(OnnxElementwise, BinaryOperatorsBroadcastOverAllShapes) {
  const std::vector<std::pair<std::string, std::function<double(double, double)>>> operators = {
      {"Add", std::plus<>()},
      {"Sub", std::minus<>()},
      {"Mul", std::multiplies<>()},
      {"Div", std::divides<>()},
      {"Min", [](double a, double b) { return std::min(a, b); }},
      {"Max", [](double a, double b) { return std::max(a, b); }},
      {"Pow", [](double a, double b) { return std::pow(a, b); }},
  };
  const std::vector<std::pair<Shape, Shape>> shapes = {
      {{2, 3}, {2, 3}}, {{2, 3}, {3}},       {{3}, {2, 3}},       {{2, 1}, {1, 3}},       {{}, {2, 2}},
      {{1, 5}, {1, 1}}, {{4, 1, 3}, {2, 1}}, {{2, 3, 4}, {3, 1}}, {{2, 3, 4}, {2, 1, 4}}, {{}, {}},
  };
  for (const auto& [op, f] : operators)
    for (const auto& [a, b] : shapes) expect_binary(op, a, b, f);
}

TEST(OnnxElementwise, SquareIsAProductAndOtherPowersAreNot) {
  const Operand x{{3}, {-3.0F, 0.5F, 2.0F}};
  expect_node("Pow", {x, {{}, {2.0F}}}, {9, 0.25, 4});
  expect_node("Pow", {x, {{}, {3.0F}}}, {-27, 0.125, 8});
}

TEST(OnnxElementwise, ClipBindsByInputsThatMayBeInfiniteOrLeftOut) {
  const float infinity = std::numeric_limits<float>::infinity();
  const Operand x{{4}, {-5.0F, -0.5F, 0.5F, 5.0F}};
  expect_node("Clip", {x, {{}, {-1.0F}}, {{}, {2.0F}}}, {-1, -0.5, 0.5, 2});
  expect_node("Clip", {x, {{}, {-infinity}}, {{}, {infinity}}}, {-5, -0.5, 0.5, 5});
  expect_node("Clip", {x, {{}, {0.0F}}}, {0, 0, 0.5, 5});
  expect_node("Clip", {x}, {-5, -0.5, 0.5, 5});
  OnnxWriter writer(11);
  const auto network =
      writer.input("x", {4}).constant("most", {}, {1.0F}).node("Clip", {"x", "", "most"}, {"y"}).output("y").network();
  EXPECT_THAT(evaluate(*network, {x.values})[0], ElementsAre(-5.0F, -0.5F, 0.5F, 1.0F));
}

TEST(OnnxElementwise, ComparisonsChooseThroughWhere) {
  const auto chosen = [](const std::string& comparison) {
    OnnxWriter writer;
    writer.input("a", {3}).input("b", {3}).constant("yes", {}, {1.0F}).constant("no", {3}, {-1.0F, -2.0F, -3.0F});
    writer.node(comparison, {"a", "b"}, {"c"}).node("Where", {"c", "yes", "no"}, {"y"}).output("y", {3});
    return evaluate(*writer.network(), {{1.0F, 2.0F, 3.0F}, {2.0F, 2.0F, 2.0F}})[0];
  };
  EXPECT_THAT(chosen("Less"), ElementsAre(1.0F, -2.0F, -3.0F));
  EXPECT_THAT(chosen("LessOrEqual"), ElementsAre(1.0F, 1.0F, -3.0F));
  EXPECT_THAT(chosen("Equal"), ElementsAre(-1.0F, 1.0F, -3.0F));
  EXPECT_THAT(chosen("GreaterOrEqual"), ElementsAre(-1.0F, 1.0F, 1.0F));
  EXPECT_THAT(chosen("Greater"), ElementsAre(-1.0F, -2.0F, 1.0F));
}

TEST(OnnxElementwise, NotTurnsTruthAround) {
  OnnxWriter writer;
  writer.input("a", {2}).constant("zero", {}, {0.0F}).node("Less", {"a", "zero"}, {"c"}).node("Not", {"c"}, {"d"});
  writer.node("Cast", {"d"}, {"y"}, {{"to", std::int64_t{1}}}).output("y");
  EXPECT_THAT(evaluate(*writer.network(), {{-1.0F, 1.0F}})[0], ElementsAre(0.0F, 1.0F));
}

TEST(OnnxElementwise, ShapesThatDoNotFitAreRefused) {
  OnnxWriter writer;
  writer.input("a", {2, 3}).input("b", {2}).node("Add", {"a", "b"}, {"y"}).output("y");
  EXPECT_SENTENCE(writer.refusal());
}

using Whole = std::vector<std::int64_t>;

// Sums of f(x) of a (2, 3, 4) tensor over the axes that are marked.
std::vector<double> sums(const Operand& x, bool first, bool second, bool third, double (*f)(double)) {
  const int A = first ? 1 : 2, B = second ? 1 : 3, C = third ? 1 : 4;
  std::vector<double> result(A * B * C, 0.0);
  for (int a = 0; a < 2; ++a)
    for (int b = 0; b < 3; ++b)
      for (int c = 0; c < 4; ++c)
        result[((first ? 0 : a) * B + (second ? 0 : b)) * C + (third ? 0 : c)] +=
            f(static_cast<double>(x.values[(a * 3 + b) * 4 + c]));
  return result;
}

double itself(double x) { return x; }
double square(double x) { return x * x; }

TEST(OnnxReduction, SumsMeansAndNormsOverAnyAxes) {
  const Operand x = operand({2, 3, 4});
  for (unsigned mask = 1; mask < 8; ++mask) {
    const bool first = (mask & 1) != 0, second = (mask & 2) != 0, third = (mask & 4) != 0;
    Whole axes;
    for (int d = 0; d < 3; ++d)
      if ((mask >> d & 1) != 0) axes.push_back(d == 2 ? -1 : d);
    const double count = (first ? 2.0 : 1.0) * (second ? 3.0 : 1.0) * (third ? 4.0 : 1.0);
    std::vector<double> sum = sums(x, first, second, third, itself), mean = sum;
    std::vector<double> squares = sums(x, first, second, third, square), norm = squares;
    for (double& value : mean) value /= count;
    for (double& value : norm) value = std::sqrt(value);
    for (const std::int64_t keep : {0, 1}) {
      const Attributes attributes = {{"axes", axes}, {"keepdims", keep}};
      expect_node("ReduceMean", {x}, mean, attributes, {11, 13, 17});
      expect_node("ReduceL2", {x}, norm, attributes, {11, 13, 17});
      expect_node("ReduceSumSquare", {x}, squares, attributes, {11, 13, 17});
      expect_node("ReduceSum", {x}, sum, attributes, {11, 12});
    }
  }
  expect_node("ReduceMean", {x}, {sums(x, true, true, true, itself)[0] / 24.0});
}

TEST(OnnxReduction, SumTakesItsAxesAsAnInputFromOperatorSet13) {
  const Operand x = operand({2, 3, 4});
  OnnxWriter writer(13);
  writer.input("x", {2, 3, 4}).whole("axes", {1}).node("ReduceSum", {"x", "axes"}, {"y"}).output("y", {2, 1, 4});
  const std::vector<float> found = evaluate(*writer.network(), {x.values})[0];
  const std::vector<double> expected = sums(x, false, true, false, itself);
  for (std::size_t k = 0; k < expected.size(); ++k) EXPECT_NEAR(found[k], expected[k], 1e-6);
  expect_node("ReduceSum", {x}, {sums(x, true, true, true, itself)[0]}, {}, {13, 17});
  EXPECT_EQ(through("ReduceSum", {x}, {{"noop_with_empty_axes", std::int64_t{1}}}, 13, 0), x.values);
}

TEST(OnnxReduction, AllTakeTheirAxesAsAnInputFromOperatorSet18) {
  const Operand x = operand({2, 3, 4});
  std::vector<double> mean = sums(x, false, true, false, itself);
  std::vector<double> squares = sums(x, false, true, false, square), norm = squares;
  for (double& value : mean) value /= 3.0;
  for (double& value : norm) value = std::sqrt(value);
  for (const auto& [op, expected] :
       {std::pair{"ReduceMean", mean}, std::pair{"ReduceL2", norm}, std::pair{"ReduceSumSquare", squares}}) {
    OnnxWriter writer(18);
    writer.input("x", {2, 3, 4}).whole("axes", {1}).node(op, {"x", "axes"}, {"y"}).output("y", {2, 1, 4});
    const std::vector<float> found = evaluate(*writer.network(), {x.values})[0];
    ASSERT_EQ(found.size(), expected.size());
    for (std::size_t k = 0; k < expected.size(); ++k) EXPECT_NEAR(found[k], expected[k], 1e-6) << op;
  }
  EXPECT_EQ(through("ReduceMean", {x}, {{"noop_with_empty_axes", std::int64_t{1}}}, 18, 0), x.values);
}

std::vector<double> softmax_of_lines(const Operand& x, int outer, int count, int stride) {
  std::vector<double> y(x.values.size());
  for (int o = 0; o < outer; ++o)
    for (int s = 0; s < stride; ++s) {
      double sum = 0.0;
      for (int k = 0; k < count; ++k) sum += std::exp(static_cast<double>(x.values[(o * count + k) * stride + s]));
      for (int k = 0; k < count; ++k)
        y[(o * count + k) * stride + s] = std::exp(static_cast<double>(x.values[(o * count + k) * stride + s])) / sum;
    }
  return y;
}

TEST(OnnxReduction, SoftmaxMeansAnotherThingBeforeOperatorSet13) {
  const Operand x = operand({2, 3, 4}, 0, 3.0);
  expect_node("Softmax", {x}, softmax_of_lines(x, 2, 12, 1), {}, {11, 12});
  expect_node("Softmax", {x}, softmax_of_lines(x, 6, 4, 1), {}, {13, 17});
  expect_node("Softmax", {x}, softmax_of_lines(x, 2, 3, 4), {{"axis", std::int64_t{1}}}, {13});
}

TEST(OnnxReduction, SoftmaxOfLargeNumbersDoesNotOverflow) {
  expect_node("Softmax", {{{2}, {1000.0F, 1000.0F}}}, {0.5, 0.5}, {{"axis", std::int64_t{0}}});
}

TEST(OnnxReduction, LayerNormalizationIsItsFormula) {
  const Operand x = operand({2, 5}, 0, 4.0), scale = operand({5}, 1), shift = operand({5}, 2);
  std::vector<double> expected;
  for (int r = 0; r < 2; ++r) {
    double mean = 0.0, variance = 0.0;
    for (int k = 0; k < 5; ++k) mean += static_cast<double>(x.values[r * 5 + k]) / 5.0;
    for (int k = 0; k < 5; ++k) variance += square(static_cast<double>(x.values[r * 5 + k]) - mean) / 5.0;
    for (int k = 0; k < 5; ++k)
      expected.push_back((static_cast<double>(x.values[r * 5 + k]) - mean) / std::sqrt(variance + 0.01) *
                             static_cast<double>(scale.values[k]) +
                         static_cast<double>(shift.values[k]));
  }
  expect_node("LayerNormalization", {x, scale, shift}, expected, {{"epsilon", 0.01F}}, {17});
}

TEST(OnnxReduction, MisfitsAreRefused) {
  const auto refusal = [](const std::string& op, int opset, const Attributes& attributes, int inputs) {
    OnnxWriter writer(opset);
    writer.input("x", {2, 3}).constant("s", {2}, {1.0F, 1.0F});
    const std::vector<std::string> names =
        inputs == 1 ? std::vector<std::string>{"x"} : std::vector<std::string>{"x", "s"};
    return writer.node(op, names, {"y"}, attributes).output("y").refusal();
  };
  EXPECT_SENTENCE(refusal("ReduceMean", 13, {{"axes", Whole{2}}}, 1));
  EXPECT_SENTENCE(refusal("ReduceSum", 11, {}, 2));
  EXPECT_SENTENCE(refusal("ReduceSum", 13, {}, 2));
  EXPECT_SENTENCE(refusal("ReduceL2", 17, {}, 2));
  EXPECT_SENTENCE(refusal("ReduceMean", 18, {{"axes", Whole{1}}}, 1));
  for (const char* op : {"ReduceL2", "ReduceSumSquare"})
    EXPECT_SENTENCE(refusal(op, 18, {{"noop_with_empty_axes", std::int64_t{1}}}, 1));
  EXPECT_SENTENCE(refusal("Softmax", 13, {{"axis", std::int64_t{-3}}}, 1));
  EXPECT_SENTENCE(refusal("LayerNormalization", 16, {}, 2));
  EXPECT_SENTENCE(refusal("LayerNormalization", 17, {}, 2));
}

}  // namespace
}  // namespace duet::test
