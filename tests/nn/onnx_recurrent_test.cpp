#include <gtest/gtest.h>

#include <cmath>

#include "tests/nn/evaluate.h"
#include "tests/nn/onnx_writer.h"
#include "tests/support.h"

namespace duet::test {
namespace {

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
