#include "duet/nn/dense_kernels.h"

#include <Eigen/Core>
#include <array>
#include <string>

#include "duet/core/require.h"

namespace duet {

extern const DenseKernels kDenseKernelsPortable;
#if defined(__x86_64__)
extern const DenseKernels kDenseKernelsV2, kDenseKernelsV3, kDenseKernelsV4;
#endif

namespace {

const std::array kWidestFirst = {
#if defined(__x86_64__)
    &kDenseKernelsV4, &kDenseKernelsV3, &kDenseKernelsV2,
#endif
    &kDenseKernelsPortable};

const DenseKernels& widest() {
  for (const DenseKernels* kernels : kWidestFirst)
    if (runs_here(kernels->level)) return *kernels;
  return kDenseKernelsPortable;
}

}  // namespace

const DenseKernels& dense_kernels() {
  static const DenseKernels& chosen = widest();
  return chosen;
}

const DenseKernels& dense_kernels(std::string_view level) {
  for (const DenseKernels* kernels : kWidestFirst)
    if (to_string(kernels->level) == level && runs_here(kernels->level)) return *kernels;
  throw std::invalid_argument("dense kernels: '" + std::string(level) +
                              "' is not one of portable, x86-64-v2, x86-64-v3, x86-64-v4 or not of this machine");
}

namespace {

using Array = Eigen::Array<float, Eigen::Dynamic, 1>;
using Map = Eigen::Map<Array>;

void sigmoid(Map x) { x = ((-x).exp() + 1.0F).inverse(); }

}  // namespace

void lstm_step(const LstmCell& cell, const float* x, float* h, float* c, float* scratch) {
  const DenseKernels& kernels = dense_kernels();
  const int n = cell.hidden;
  float* gates = scratch + 4 * n;
  kernels.gemv(4 * n, cell.inputs, cell.W, x, cell.b, scratch);
  kernels.gemv(4 * n, n, cell.R, h, scratch, gates);
  const auto gate = [&](int which) { return Map(gates + cell.order[which] * n, n); };
  for (const int which : {0, 1, 3}) sigmoid(gate(which));
  Map memory(c, n), hidden(h, n);
  memory = gate(1) * memory + gate(0) * gate(2).tanh();
  hidden = gate(3) * memory.tanh();
}

void gru_step(const GruCell& cell, const float* x, float* h, float* scratch) {
  const DenseKernels& kernels = dense_kernels();
  const int n = cell.hidden;
  float *of_x = scratch, *of_h = scratch + 3 * n;
  kernels.gemv(3 * n, cell.inputs, cell.W, x, cell.bW, of_x);
  kernels.gemv(3 * n, n, cell.R, h, cell.bR, of_h);
  Map update(of_x, n), reset(of_x + n, n), fresh(of_x + 2 * n, n), hidden(h, n);
  update += Map(of_h, n);
  reset += Map(of_h + n, n);
  sigmoid(update);
  sigmoid(reset);
  Map new_of_h(of_h + 2 * n, n);
  if (cell.linear_before_reset) {
    fresh = (fresh + reset * new_of_h).tanh();
  } else {
    Map kept(scratch + 6 * n, n);
    kept = reset * hidden;
    kernels.gemv(n, n, cell.R + 2 * n * n, kept.data(), cell.bR + 2 * n, new_of_h.data());
    fresh = (fresh + new_of_h).tanh();
  }
  hidden = (1.0F - update) * fresh + update * hidden;
}

}  // namespace duet
