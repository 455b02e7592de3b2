// Body of one level of DenseKernels. Each kernel_*.cpp defines DUET_KERNEL (the table's name) and DUET_LEVEL and
// compiles it with its own -march. Eigen's name is changed by level: the linker would otherwise keep one of the four
// copies of each of its inline functions, possibly one that the machine cannot run.
#define Eigen DUET_EIGEN
#include <Eigen/Core>
#include <cstring>
#ifdef __F16C__
#include <immintrin.h>
#endif

#include "duet/nn/dense_kernels.h"

namespace duet {
namespace {

using Matrix = Eigen::Matrix<float, Eigen::Dynamic, Eigen::Dynamic>;
using RowMatrix = Eigen::Matrix<float, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
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

using Wide = Eigen::Array<float, kHalfColumns, 1>;

// kHalfColumns numbers in half precision as floats. Eigen's cast is not vectorised.
Wide widen(const std::uint16_t* halves) {
  Wide wide;
#if defined(__AVX512F__)
  _mm512_storeu_ps(wide.data(), _mm512_cvtph_ps(_mm256_loadu_si256(reinterpret_cast<const __m256i*>(halves))));
#elif defined(__F16C__)
  for (int i = 0; i < kHalfColumns; i += 8)
    _mm256_storeu_ps(wide.data() + i, _mm256_cvtph_ps(_mm_loadu_si128(reinterpret_cast<const __m128i*>(halves + i))));
#else
  for (int i = 0; i < kHalfColumns; ++i) {
    Eigen::half half;
    half.x = halves[i];
    wide[i] = static_cast<float>(half);
  }
#endif
  return wide;
}

// Four rows at a time, whose sums do not wait for each other; what is read is one stream.
void gemv_half(int rows, int cols, const std::uint16_t* W, const float* x, const float* b, float* y) {
  constexpr int kAhead = 1024, kLine = 32;  // halves
  for (int row = 0; row < rows; row += kHalfRows) {
    Wide s0 = Wide::Zero(), s1 = Wide::Zero(), s2 = Wide::Zero(), s3 = Wide::Zero();
    for (int c = 0; c < cols; c += kHalfColumns, W += kHalfRows * kHalfColumns) {
      __builtin_prefetch(W + kAhead);
      __builtin_prefetch(W + kAhead + kLine);
      const Wide value = Eigen::Map<const Wide>(x + c);
      s0 += widen(W) * value;
      s1 += widen(W + kHalfColumns) * value;
      s2 += widen(W + 2 * kHalfColumns) * value;
      s3 += widen(W + 3 * kHalfColumns) * value;
    }
    const float sums[kHalfRows] = {s0.sum(), s1.sum(), s2.sum(), s3.sum()};
    for (int i = 0; i < kHalfRows && row + i < rows; ++i) y[row + i] = sums[i] + (b != nullptr ? b[row + i] : 0.0F);
  }
}

// Element by element in blocks that are copied to aligned places. Eigen treats the ends of an unaligned array with
// other instructions than its middle, so that the bits would depend on where memory happened to lie.
constexpr int kBlock = 64;
using Block = Eigen::Array<float, kBlock, 1>;

Block load(const float* from, int n) {
  Block block = Block::Zero();
  std::memcpy(block.data(), from, static_cast<std::size_t>(n) * sizeof(float));
  return block;
}

void store(const Block& block, float* to, int n) {
  std::memcpy(to, block.data(), static_cast<std::size_t>(n) * sizeof(float));
}

template <typename F>
void in_blocks(int n, const F& f) {
  for (int i = 0; i < n; i += kBlock) f(i, n - i < kBlock ? n - i : kBlock);
}

void elu(int n, float* x) {
  in_blocks(n, [x](int at, int count) {
    const Block a = load(x + at, count);
    // The positive and the negative part; a selection would not be vectorised. NaN stays NaN.
    const Block value = a.max(0.0F) + (a.min(0.0F).exp() - 1.0F);
    store(value, x + at, count);
  });
}

void elu_backward(int n, const float* a, float* d) {
  in_blocks(n, [a, d](int at, int count) {
    const Block gradient = load(d + at, count) * (load(a + at, count).min(0.0F) + 1.0F);
    store(gradient, d + at, count);
  });
}

void adam(int n, const float* g, float scale, float step, float correction, float* m, float* v, float* p) {
  constexpr float kBeta1 = 0.9F, kBeta2 = 0.999F, kEpsilon = 1e-8F;
  in_blocks(n, [=](int at, int count) {
    const Block gradient = scale * load(g + at, count);
    const Block first = kBeta1 * load(m + at, count) + (1.0F - kBeta1) * gradient;
    const Block second = kBeta2 * load(v + at, count) + (1.0F - kBeta2) * gradient.square();
    const Block value = load(p + at, count) - step * first / ((second / correction).sqrt() + kEpsilon);
    store(first, m + at, count);
    store(second, v + at, count);
    store(value, p + at, count);
  });
}

}  // namespace

extern const DenseKernels DUET_KERNEL;
const DenseKernels DUET_KERNEL = {.level = DUET_LEVEL,
                                  .gemm = gemm,
                                  .gemv = gemv,
                                  .gemv_half = gemv_half,
                                  .elu = elu,
                                  .elu_backward = elu_backward,
                                  .adam = adam};

}  // namespace duet
