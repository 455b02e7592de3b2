// One step of an LSTM and of a GRU, for ONNX's nodes and for TorchScript. Float: this is a kernel room. No state, no
// allocation; the weights are borrowed.
#pragma once

#include <array>

namespace duet {

struct LstmCell {
  int inputs = 0, hidden = 0;
  const float *W = nullptr, *R = nullptr;  // (4 hidden, inputs), (4 hidden, hidden), row-major, of the four gates
  const float* b = nullptr;                // (4 hidden): the sum of both biases
  std::array<int, 4> order{};              // where input, forget, cell and output gate stand among the four
};

inline constexpr std::array<int, 4> kTorchLstmOrder = {0, 1, 2, 3}, kOnnxLstmOrder = {0, 2, 3, 1};

// h and c (hidden) are replaced; scratch: 8 hidden.
void lstm_step(const LstmCell& cell, const float* x, float* h, float* c, float* scratch);

// Gates in the order update (z), reset (r), new. ONNX's formulas.
struct GruCell {
  int inputs = 0, hidden = 0;
  const float *W = nullptr, *R = nullptr;    // (3 hidden, inputs), (3 hidden, hidden)
  const float *bW = nullptr, *bR = nullptr;  // (3 hidden) each
  bool linear_before_reset = false;          // what PyTorch does
};

// h (hidden) is replaced; scratch: 7 hidden.
void gru_step(const GruCell& cell, const float* x, float* h, float* scratch);

}  // namespace duet
