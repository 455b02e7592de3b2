// Dense linear algebra in float for networks: one source compiled for four instruction sets, chosen at run time. The
// only float arithmetic of the project beside PAIR's lanes. Thread-safe: no state. gemv, gemv_half and elu do not
// allocate; gemm may (blocking buffers).
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <string_view>

#include "duet/core/machine.h"

namespace duet {

// How gemv_half wants its weights: half_size of them, rows and columns filled up with zeros to multiples of these, and
// element (row, c) at half_index. `cols` is a multiple of kHalfColumns.
inline constexpr int kHalfRows = 4, kHalfColumns = 16;
constexpr std::size_t half_size(int rows, int cols) {
  return static_cast<std::size_t>((rows + kHalfRows - 1) / kHalfRows * kHalfRows) * static_cast<std::size_t>(cols);
}
constexpr std::size_t half_index(int row, int c, int cols) {
  const int block = row / kHalfRows * (cols / kHalfColumns) + c / kHalfColumns;
  return (static_cast<std::size_t>(block) * kHalfRows + row % kHalfRows) * kHalfColumns + c % kHalfColumns;
}

struct DenseKernels {
  InstructionSet level;  // what it was compiled for
  // C = op(A) op(B), or C += it with `accumulate`. Column-major without gaps: C is (m, n), op(A) (m, k), op(B) (k, n).
  void (*gemm)(bool transpose_a, bool transpose_b, int m, int n, int k, const float* A, const float* B, float* C,
               bool accumulate);
  // y = W x + b, W (rows, cols) row-major as PyTorch and ONNX store it; b may be null.
  void (*gemv)(int rows, int cols, const float* W, const float* x, const float* b, float* y);
  // The same with W in IEEE half precision: half the memory to read, which is what gemv waits for. `cols` is a multiple
  // of kHalfColumns, W in the order of half_index; products and sums are in float.
  void (*gemv_half)(int rows, int cols, const std::uint16_t* W, const float* x, const float* b, float* y);
  // x <- elu(x), in place; and d <- d elu'(.), where `a` holds elu's results.
  void (*elu)(int n, float* x);
  void (*elu_backward)(int n, const float* a, float* d);
  // One step of Adam on n parameters p with gradient g, already scaled: moments m and v are updated.
  // step: lr / (1 - beta1^t); v is divided by `correction` = 1 - beta2^t.
  void (*adam)(int n, const float* g, float scale, float step, float correction, float* m, float* v, float* p);
};

// The widest set that this machine has; or the one named ("x86-64-v3", "portable"), for tests (throws
// std::invalid_argument where it is unknown or the machine lacks it).
const DenseKernels& dense_kernels();
const DenseKernels& dense_kernels(std::string_view level);

// One step of an LSTM and of a GRU, for ONNX's nodes and for TorchScript. Float: this is a kernel room. No state, no
// allocation; the weights are borrowed.

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
