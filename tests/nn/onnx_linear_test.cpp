#include <gtest/gtest.h>

#include <cmath>

#include "tests/nn/evaluate.h"
#include "tests/nn/onnx_writer.h"
#include "tests/support.h"

namespace duet::test {
namespace {

// Element (r, c) of a matrix of the operand, which starts at `from` and has `cols` columns.
double element(const Operand& x, std::int64_t from, std::int64_t cols, std::int64_t r, std::int64_t c) {
  return static_cast<double>(x.values[from + r * cols + c]);
}

std::vector<double> product(const Operand& a, const Operand& b, std::int64_t m, std::int64_t n, std::int64_t k,
                            std::int64_t from_a = 0, std::int64_t from_b = 0) {
  std::vector<double> y;
  for (std::int64_t r = 0; r < m; ++r)
    for (std::int64_t c = 0; c < n; ++c) {
      y.push_back(0.0);
      for (std::int64_t i = 0; i < k; ++i) y.back() += element(a, from_a, k, r, i) * element(b, from_b, n, i, c);
    }
  return y;
}

Operand transposed(const Operand& x) {
  Operand y{{x.shape[1], x.shape[0]}, {}};
  for (std::int64_t c = 0; c < x.shape[1]; ++c)
    for (std::int64_t r = 0; r < x.shape[0]; ++r) y.values.push_back(x.values[r * x.shape[1] + c]);
  return y;
}

TEST(OnnxLinear, GemmOfEveryTranspositionScaleAndBias) {
  constexpr std::int64_t n = 5, k = 7;
  for (const std::int64_t m : {1, 3})
    for (const bool ta : {false, true})
      for (const bool tb : {false, true})
        for (const Shape& bias : {Shape{}, Shape{n}, Shape{1, n}, Shape{m, 1}, Shape{m, n}}) {
          const Operand a = operand({m, k}, 0), b = operand({k, n}, 1), c = operand(bias, 2);
          std::vector<double> expected = product(a, b, m, n, k);
          for (std::int64_t e = 0; e < m * n; ++e) {
            const std::int64_t r = bias.size() == 2 && bias[0] > 1 ? e / n : 0;
            const std::int64_t col = !bias.empty() && bias.back() > 1 ? e % n : 0;
            const std::int64_t width = bias.empty() ? 1 : bias.back();
            expected[e] = 0.5 * expected[e] + 2.0 * static_cast<double>(c.values[r * width + col]);
          }
          expect_node("Gemm", {ta ? transposed(a) : a, tb ? transposed(b) : b, c}, expected,
                      {{"alpha", 0.5F},
                       {"beta", 2.0F},
                       {"transA", std::int64_t{ta ? 1 : 0}},
                       {"transB", std::int64_t{tb ? 1 : 0}}},
                      {13});
        }
}

TEST(OnnxLinear, GemmWithoutBias) {
  const Operand a = operand({2, 9}, 0), b = operand({9, 4}, 1);
  expect_node("Gemm", {a, b}, product(a, b, 2, 4, 9));
}

TEST(OnnxLinear, MatMulOfVectorsMatricesAndStacks) {
  const Operand v = operand({3}, 0), M = operand({2, 3}, 1), N = operand({3, 4}, 2), S = operand({5, 2, 3}, 3);
  expect_node("MatMul", {v, operand({3}, 4)}, product(v, operand({3}, 4), 1, 1, 3));
  expect_node("MatMul", {M, v}, product(M, v, 2, 1, 3));
  expect_node("MatMul", {v, N}, product(v, N, 1, 4, 3));
  expect_node("MatMul", {M, N}, product(M, N, 2, 4, 3));
  expect_node("MatMul", {S, N}, product(S, N, 10, 4, 3));
  const Operand T = operand({5, 3, 4}, 5), left = operand({2, 1, 2, 3}, 6), right = operand({4, 3, 2}, 7);
  std::vector<double> stacked, crossed;
  for (std::int64_t s = 0; s < 5; ++s)
    for (const double value : product(S, T, 2, 4, 3, s * 6, s * 12)) stacked.push_back(value);
  for (std::int64_t s = 0; s < 8; ++s)
    for (const double value : product(left, right, 2, 2, 3, s / 4 * 6, s % 4 * 6)) crossed.push_back(value);
  expect_node("MatMul", {S, T}, stacked);
  expect_node("MatMul", {left, right}, crossed);
}

struct ConvCase {
  std::int64_t channels, length, out, kernel, stride, dilation, before, after, groups;
};

std::vector<double> convolved(const ConvCase& c, const Operand& x, const Operand& W, const Operand& bias) {
  const std::int64_t in = c.channels / c.groups, per_group = c.out / c.groups;
  std::vector<double> y;
  for (std::int64_t o = 0; o < c.out; ++o)
    for (std::int64_t begin = -c.before; begin + (c.kernel - 1) * c.dilation < c.length + c.after; begin += c.stride) {
      y.push_back(static_cast<double>(bias.values[o]));
      for (std::int64_t i = 0; i < in; ++i)
        for (std::int64_t k = 0; k < c.kernel; ++k) {
          const std::int64_t at = begin + k * c.dilation, channel = o / per_group * in + i;
          if (at < 0 || at >= c.length) continue;
          y.back() += static_cast<double>(x.values[channel * c.length + at]) *
                      static_cast<double>(W.values[(o * in + i) * c.kernel + k]);
        }
    }
  return y;
}

TEST(OnnxLinear, ConvolutionEqualsTheSum) {
  for (const ConvCase& c : {ConvCase{6, 10, 4, 4, 2, 1, 0, 0, 1}, ConvCase{4, 4, 2, 2, 1, 1, 0, 0, 1},
                            ConvCase{2, 9, 2, 3, 1, 2, 1, 2, 1}, ConvCase{4, 5, 6, 3, 2, 1, 1, 1, 2}}) {
    const Operand x = operand({1, c.channels, c.length}, 0), bias = operand({c.out}, 2);
    const Operand W = operand({c.out, c.channels / c.groups, c.kernel}, 1);
    expect_node("Conv", {x, W, bias}, convolved(c, x, W, bias),
                {{"strides", std::vector<std::int64_t>{c.stride}},
                 {"dilations", std::vector<std::int64_t>{c.dilation}},
                 {"pads", std::vector<std::int64_t>{c.before, c.after}},
                 {"group", c.groups}},
                {11});
  }
}

TEST(OnnxLinear, AutomaticPaddingPutsTheOddZeroWhereItSays) {
  const Operand x = operand({1, 1, 5}, 0), W = operand({1, 1, 4}, 1), zero{{1}, {0.0F}};
  const ConvCase upper{1, 5, 1, 4, 1, 1, 1, 2, 1}, lower{1, 5, 1, 4, 1, 1, 2, 1, 1}, valid{1, 5, 1, 4, 1, 1, 0, 0, 1};
  expect_node("Conv", {x, W}, convolved(upper, x, W, zero), {{"auto_pad", std::string("SAME_UPPER")}});
  expect_node("Conv", {x, W}, convolved(lower, x, W, zero), {{"auto_pad", std::string("SAME_LOWER")}});
  expect_node("Conv", {x, W}, convolved(valid, x, W, zero), {{"auto_pad", std::string("VALID")}});
}

std::string refusal(const std::string& op, const std::vector<Shape>& shapes, const Attributes& attributes = {}) {
  OnnxWriter writer;
  std::vector<std::string> names;
  for (const Shape& shape : shapes) {
    names.push_back("in" + std::to_string(names.size()));
    writer.input(names.back(), shape);
  }
  return writer.node(op, names, {"y"}, attributes).output("y").refusal();
}

TEST(OnnxLinear, MisfitsAreRefused) {
  EXPECT_SENTENCE(refusal("Gemm", {{2, 3}, {2, 3}}));
  EXPECT_SENTENCE(refusal("Gemm", {{2, 3}, {3}}));
  EXPECT_SENTENCE(refusal("Gemm", {{2, 3}, {3, 4}, {5}}));
  EXPECT_SENTENCE(refusal("Gemm", {{1, 3}, {3, 4}, {2, 4}}));
  EXPECT_SENTENCE(refusal("MatMul", {{2, 3}, {2, 3}}));
  EXPECT_SENTENCE(refusal("MatMul", {{}, {2}}));
  EXPECT_SENTENCE(refusal("Conv", {{1, 3, 4, 4}, {2, 3, 2, 2}}));
  EXPECT_SENTENCE(refusal("Conv", {{1, 3, 4}, {2, 2, 2}}));
  EXPECT_SENTENCE(refusal("Conv", {{1, 2, 3}, {2, 2, 4}}));
  EXPECT_SENTENCE(refusal("Conv", {{1, 2, 3}, {2, 2, 2}}, {{"strides", std::vector<std::int64_t>{0}}}));
}

constexpr int kSteps = 3, kInputs = 5, kHidden = 4;

double sigmoid(double x) { return 1.0 / (1.0 + std::exp(-x)); }

struct Weights {
  Operand x, W, R, B, h, c;
};

Weights weights(std::int64_t gates) {
  return {operand({kSteps, 1, kInputs}, 0),
          operand({1, gates * kHidden, kInputs}, 1),
          operand({1, gates * kHidden, kHidden}, 2),
          operand({1, 2 * gates * kHidden}, 3),
          operand({1, 1, kHidden}, 4),
          operand({1, 1, kHidden}, 5)};
}

// Row `row` of W x_t + Wb, and of R h + Rb.
double of_input(const Weights& w, int t, int row) {
  double sum = static_cast<double>(w.B.values[row]);
  for (int k = 0; k < kInputs; ++k)
    sum += static_cast<double>(w.W.values[row * kInputs + k]) * static_cast<double>(w.x.values[t * kInputs + k]);
  return sum;
}

double of_state(const Weights& w, int gates, const std::vector<double>& h, int row) {
  double sum = static_cast<double>(w.B.values[gates * kHidden + row]);
  for (int k = 0; k < kHidden; ++k) sum += static_cast<double>(w.R.values[row * kHidden + k]) * h[k];
  return sum;
}

std::vector<double> doubles(const Operand& x) { return {x.values.begin(), x.values.end()}; }

// The last hidden state; ONNX's gates stand in the order i, o, f, c.
std::vector<double> lstm(const Weights& w, std::vector<double> h, std::vector<double> c) {
  for (int t = 0; t < kSteps; ++t) {
    const std::vector<double> old = h;
    const auto gate = [&](int g, int k) {
      return of_input(w, t, g * kHidden + k) + of_state(w, 4, old, g * kHidden + k);
    };
    for (int k = 0; k < kHidden; ++k) {
      c[k] = sigmoid(gate(2, k)) * c[k] + sigmoid(gate(0, k)) * std::tanh(gate(3, k));
      h[k] = sigmoid(gate(1, k)) * std::tanh(c[k]);
    }
  }
  return h;
}

// Gates z, r, h.
std::vector<double> gru(const Weights& w, std::vector<double> h, bool linear_before_reset) {
  for (int t = 0; t < kSteps; ++t) {
    const std::vector<double> old = h;
    const auto gate = [&](int g, int k) {
      return sigmoid(of_input(w, t, g * kHidden + k) + of_state(w, 3, old, g * kHidden + k));
    };
    std::vector<double> reset = old;
    for (int k = 0; k < kHidden; ++k) reset[k] *= gate(1, k);
    for (int k = 0; k < kHidden; ++k) {
      const int row = 2 * kHidden + k;
      const double before = linear_before_reset ? gate(1, k) * of_state(w, 3, old, row) : of_state(w, 3, reset, row);
      const double fresh = std::tanh(of_input(w, t, row) + before);
      h[k] = (1.0 - gate(0, k)) * fresh + gate(0, k) * old[k];
    }
  }
  return h;
}

// Y, Y_h and, of an LSTM, Y_c.
std::vector<std::vector<float>> run(const std::string& op, const Weights& w, bool with_state,
                                    const Attributes& attributes = {}) {
  OnnxWriter writer(14);
  std::vector<std::string> inputs = {"x", "W", "R", "B"}, outputs = {"Y", "Y_h"};
  writer.input("x", w.x.shape).constant("W", w.W.shape, w.W.values).constant("R", w.R.shape, w.R.values);
  writer.constant("B", w.B.shape, w.B.values);
  std::vector<std::vector<float>> values = {w.x.values};
  if (with_state) {
    inputs.insert(inputs.end(), {"", "h"});
    writer.input("h", w.h.shape);
    values.push_back(w.h.values);
    if (op == "LSTM") {
      inputs.emplace_back("c");
      writer.input("c", w.c.shape);
      values.push_back(w.c.values);
    }
  }
  if (op == "LSTM") outputs.emplace_back("Y_c");
  writer.node(op, inputs, outputs, attributes);
  for (const std::string& name : outputs) writer.output(name);
  return evaluate(*writer.network(), values);
}

void expect_last(const std::vector<std::vector<float>>& found, const std::vector<double>& expected) {
  ASSERT_EQ(found[0].size(), kSteps * kHidden);
  for (int k = 0; k < kHidden; ++k) {
    EXPECT_NEAR(found[1][k], expected[k], 1e-6);
    EXPECT_EQ(found[0][(kSteps - 1) * kHidden + k], found[1][k]);
  }
}

TEST(OnnxRecurrent, LstmEqualsItsFormula) {
  const Weights w = weights(4);
  const std::vector<double> zero(kHidden, 0.0);
  expect_last(run("LSTM", w, false), lstm(w, zero, zero));
  expect_last(run("LSTM", w, true), lstm(w, doubles(w.h), doubles(w.c)));
}

TEST(OnnxRecurrent, GruEqualsItsFormulaInBothForms) {
  const Weights w = weights(3);
  for (const std::int64_t linear : {0, 1}) {
    const Attributes attributes = {{"linear_before_reset", linear}};
    expect_last(run("GRU", w, false, attributes), gru(w, std::vector<double>(kHidden, 0.0), linear == 1));
    expect_last(run("GRU", w, true, attributes), gru(w, doubles(w.h), linear == 1));
  }
}

TEST(OnnxRecurrent, EveryEvaluationBeginsAnew) {
  const Weights w = weights(3);
  OnnxWriter writer;
  writer.input("x", w.x.shape).constant("W", w.W.shape, w.W.values).constant("R", w.R.shape, w.R.values);
  const auto network = writer.node("GRU", {"x", "W", "R"}, {"Y"}).output("Y").network();
  EXPECT_EQ(evaluate(*network, {w.x.values}), evaluate(*network, {w.x.values}));
}

TEST(OnnxRecurrent, OtherKindsAreRefused) {
  const Weights w = weights(4);
  const auto refusal = [&](const Attributes& attributes, const Shape& R) {
    OnnxWriter writer;
    writer.input("x", w.x.shape).constant("W", w.W.shape, w.W.values);
    writer.constant("R", R, operand(R).values).node("LSTM", {"x", "W", "R"}, {"Y"}, attributes).output("Y");
    return writer.refusal();
  };
  EXPECT_SENTENCE(refusal({{"direction", std::string("bidirectional")}}, w.R.shape));
  EXPECT_SENTENCE(refusal({{"clip", 1.0F}}, w.R.shape));
  EXPECT_SENTENCE(refusal({{"hidden_size", std::int64_t{3}}}, w.R.shape));
  EXPECT_SENTENCE(refusal({}, {1, 12, 3}));
  EXPECT_SENTENCE(refusal({}, {16, 4}));
}

}  // namespace
}  // namespace duet::test
