// LSTM and GRU nodes: one direction, forward, the usual activations, weights known at load. Float: this is a kernel
// room.
#include <fmt/format.h>

#include <algorithm>

#include "duet/nn/dense_kernels.h"
#include "duet/nn/onnx/onnx_plan.h"

namespace duet {
namespace {

// The common part of LSTM and GRU: X (steps, batch, inputs), W (1, gates H, inputs), R (1, gates H, H), B (1, 2 gates
// H), initial states (1, batch, H).
struct Recurrence {
  std::int64_t steps = 1, batch = 1, inputs = 1, hidden = 1, gates = 1;
  const float *x = nullptr, *W = nullptr, *R = nullptr;
  const float *bW = nullptr, *bR = nullptr;      // zeros where the node has none
  const float* initial[2] = {nullptr, nullptr};  // h, c; null: zeros
  float *y = nullptr, *state[2] = {nullptr, nullptr}, *scratch = nullptr;
};

void check_kind(const OnnxBuilder& builder) {
  builder.require(builder.text("direction", "forward") == "forward", "expected the direction 'forward', found another");
  for (const char* name : {"activations", "activation_alpha", "activation_beta", "clip"})
    builder.require(builder.attribute(name) == nullptr, fmt::format("attribute '{}' is not supported", name));
  builder.require(builder.integer("layout", 0) == 0, "attribute 'layout': expected 0");
  builder.require(builder.integer("input_forget", 0) == 0, "attribute 'input_forget': expected 0");
  builder.require(!builder.has_input(4), "sequence lengths are not supported");
  builder.require(!builder.has_input(7), "peephole weights are not supported");
}

const float* constant_of(const OnnxBuilder& builder, int i, const Shape& shape) {
  const OnnxValue& value = builder.float_input(i);
  builder.require(value.constant, fmt::format("input {}: expected weights, found what depends on the input", i));
  builder.require(value.shape == shape,
                  fmt::format("input {}: expected shape {}, found {}", i, shape_text(shape), shape_text(value.shape)));
  return value.data;
}

Recurrence recurrence(OnnxBuilder& builder, std::int64_t gates) {
  check_kind(builder);
  const OnnxValue &x = builder.float_input(0), &R = builder.float_input(2);
  builder.require(x.rank() == 3 && R.rank() == 3, fmt::format("expected three dimensions, found shapes {} and {}",
                                                              shape_text(x.shape), shape_text(R.shape)));
  Recurrence r;
  r.gates = gates;
  r.steps = x.shape[0];
  r.batch = x.shape[1];
  r.inputs = x.shape[2];
  r.hidden = R.shape[2];
  builder.require(r.hidden > 0 && builder.integer("hidden_size", r.hidden) == r.hidden,
                  fmt::format("hidden_size: expected {}", r.hidden));
  r.x = x.data;
  r.W = constant_of(builder, 1, {1, gates * r.hidden, r.inputs});
  r.R = constant_of(builder, 2, {1, gates * r.hidden, r.hidden});
  r.bW =
      builder.has_input(3) ? constant_of(builder, 3, {1, 2 * gates * r.hidden}) : builder.memory(2 * gates * r.hidden);
  r.bR = r.bW + gates * r.hidden;
  return r;
}

// Initial states from input 5 on, outputs Y, Y_h and, of an LSTM, Y_c.
void add_states(OnnxBuilder& builder, Recurrence& r, int states) {
  const Shape shape = {1, r.batch, r.hidden};
  r.y = builder.output(0, {r.steps, 1, r.batch, r.hidden});
  for (int s = 0; s < states; ++s) {
    r.state[s] = builder.output(1 + s, shape);
    if (!builder.has_input(5 + s)) continue;
    builder.require(builder.float_input(5 + s).shape == shape,
                    fmt::format("input {}: expected shape {}, found {}", 5 + s, shape_text(shape),
                                shape_text(builder.input(5 + s).shape)));
    r.initial[s] = builder.input(5 + s).data;
  }
  r.scratch = builder.memory(8 * r.hidden);
}

// advance(x, place): one step of one member of the batch, whose states begin at `place`.
template <typename Advance>
void run(const Recurrence& r, int states, const Advance& advance) {
  const std::int64_t size = r.batch * r.hidden;
  for (int s = 0; s < states; ++s) {
    if (r.initial[s] != nullptr)
      std::copy_n(r.initial[s], size, r.state[s]);
    else
      std::fill_n(r.state[s], size, 0.0F);
  }
  for (std::int64_t t = 0; t < r.steps; ++t) {
    for (std::int64_t b = 0; b < r.batch; ++b) advance(r.x + (t * r.batch + b) * r.inputs, b * r.hidden);
    std::copy_n(r.state[0], size, r.y + t * size);
  }
}

void lstm(OnnxBuilder& builder) {
  Recurrence r = recurrence(builder, 4);
  add_states(builder, r, 2);
  float* bias = builder.memory(4 * r.hidden);
  std::transform(r.bW, r.bW + 4 * r.hidden, r.bR, bias, std::plus<>());
  const LstmCell cell{.inputs = static_cast<int>(r.inputs),
                      .hidden = static_cast<int>(r.hidden),
                      .W = r.W,
                      .R = r.R,
                      .b = bias,
                      .order = kOnnxLstmOrder};
  builder.step([r, cell] {
    run(r, 2, [&](const float* x, std::int64_t place) {
      lstm_step(cell, x, r.state[0] + place, r.state[1] + place, r.scratch);
    });
  });
}

void gru(OnnxBuilder& builder) {
  Recurrence r = recurrence(builder, 3);
  add_states(builder, r, 1);
  const GruCell cell{.inputs = static_cast<int>(r.inputs),
                     .hidden = static_cast<int>(r.hidden),
                     .W = r.W,
                     .R = r.R,
                     .bW = r.bW,
                     .bR = r.bR,
                     .linear_before_reset = builder.integer("linear_before_reset", 0) != 0};
  builder.step([r, cell] {
    run(r, 1, [&](const float* x, std::int64_t place) { gru_step(cell, x, r.state[0] + place, r.scratch); });
  });
}

constexpr OnnxOperator kRecurrentOperators[] = {
    {"GRU", 3, 6, 2, gru},
    {"LSTM", 3, 8, 3, lstm},
};

}  // namespace

std::span<const OnnxOperator> recurrent_operators() { return kRecurrentOperators; }

}  // namespace duet
