// Body of one level of DenseKernels. Each kernel_*.cpp defines DUET_KERNEL (the table's name) and DUET_LEVEL and compiles
// it with its own -march. Eigen's name is changed by level: the linker would otherwise keep one of the three copies of
// each of its inline functions, possibly one that the machine cannot run.
#define Eigen DUET_EIGEN
#include <Eigen/Core>

#include "nn/dense_kernels.h"

namespace duet {
namespace {

using Matrix = Eigen::Matrix<float, Eigen::Dynamic, Eigen::Dynamic>;
using RowMatrix = Eigen::Matrix<float, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
using Array = Eigen::Array<float, Eigen::Dynamic, 1>;
using Vector = Eigen::Matrix<float, Eigen::Dynamic, 1>;

template <typename A, typename B>
void product(const A& a, const B& b, Eigen::Map<Matrix> c, bool accumulate) {
  if (accumulate)
    c.noalias() += a * b;
  else
    c.noalias() = a * b;
}

void gemm(bool transpose_a, bool transpose_b, int m, int n, int k, const float* A, const float* B, float* C,
          bool accumulate) {
  const Eigen::Map<const Matrix> a(A, transpose_a ? k : m, transpose_a ? m : k);
  const Eigen::Map<const Matrix> b(B, transpose_b ? n : k, transpose_b ? k : n);
  const Eigen::Map<Matrix> c(C, m, n);
  if (transpose_a && transpose_b)
    product(a.transpose(), b.transpose(), c, accumulate);
  else if (transpose_a)
    product(a.transpose(), b, c, accumulate);
  else if (transpose_b)
    product(a, b.transpose(), c, accumulate);
  else
    product(a, b, c, accumulate);
}

void gemv(int rows, int cols, const float* W, const float* x, const float* b, float* y) {
  Eigen::Map<Vector> out(y, rows);
  if (b != nullptr)
    out = Eigen::Map<const Vector>(b, rows);
  else
    out.setZero();
  out.noalias() += Eigen::Map<const RowMatrix>(W, rows, cols) * Eigen::Map<const Vector>(x, cols);
}

void elu(int n, float* x) {
  Eigen::Map<Array> a(x, n);
  a = (a > 0.0F).select(a, a.min(0.0F).exp() - 1.0F);
}

void elu_backward(int n, const float* a, float* d) {
  const Eigen::Map<const Array> value(a, n);
  Eigen::Map<Array> gradient(d, n);
  gradient *= (value.min(0.0F) + 1.0F);
}

void adam(int n, const float* g, float scale, float step, float correction, float* m, float* v, float* p) {
  constexpr float kBeta1 = 0.9F, kBeta2 = 0.999F, kEpsilon = 1e-8F;
  const Eigen::Map<const Array> gradient(g, n);
  Eigen::Map<Array> first(m, n), second(v, n), value(p, n);
  first = kBeta1 * first + (1.0F - kBeta1) * scale * gradient;
  second = kBeta2 * second + (1.0F - kBeta2) * (scale * gradient).square();
  value -= step * first / ((second / correction).sqrt() + kEpsilon);
}

}  // namespace

extern const DenseKernels DUET_KERNEL;
const DenseKernels DUET_KERNEL = {.level = DUET_LEVEL,
                                  .gemm = gemm,
                                  .gemv = gemv,
                                  .elu = elu,
                                  .elu_backward = elu_backward,
                                  .adam = adam};

}  // namespace duet
