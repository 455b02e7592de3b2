#include <gtest/gtest.h>

#include <cmath>

#include "tests/nn/evaluate.h"
#include "tests/nn/onnx_writer.h"
#include "tests/support.h"

namespace duet::test {
namespace {

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
