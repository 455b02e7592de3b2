// Body of one level of DenseKernels. Each kernel_*.cpp defines DUET_KERNEL (the table's name) and DUET_LEVEL and
// compiles it with its own -march. Eigen's name is changed by level: the linker would otherwise keep one of the four
// copies of each of its inline functions, possibly one that the machine cannot run. For the same reason no template of
// the standard library is called here.
//
// Levels with fused multiply-add (x86-64-v3 and -v4) give the same bits: the order of each sum and what is fused in it
// are written out, and neither hangs on the width of the registers.
#define Eigen DUET_EIGEN
#include <Eigen/Core>
#include <cstring>
#ifdef __F16C__
#include <immintrin.h>
#endif

#include "duet/nn/dense_kernels.h"

namespace duet {
namespace {

// a b + c, rounded once where the level has an instruction for it.
float fused(float a, float b, float c) {
#if defined(__FMA__) || defined(__aarch64__)
  return __builtin_fmaf(a, b, c);
#else
  return a * b + c;
#endif
}

// The lanes of a sum: lane i adds the terms i, i + 16, ..., whatever the width of the machine's registers, so that AVX2
// and AVX-512 give the same bits.
namespace packets = Eigen::internal;
using Packet = packets::packet_traits<float>::type;
constexpr int kLanes = kHalfColumns, kPacket = packets::packet_traits<float>::size, kPackets = kLanes / kPacket;

struct Lanes {
  Packet packet[kPackets];
};

Lanes zeros() {
  Lanes lanes;
  for (Packet& packet : lanes.packet) packet = packets::pset1<Packet>(0.0F);
  return lanes;
}

Lanes load(const float* from) {
  Lanes lanes;
  for (int i = 0; i < kPackets; ++i) lanes.packet[i] = packets::ploadu<Packet>(from + i * kPacket);
  return lanes;
}

void store(const Lanes& lanes, float* to) {
  for (int i = 0; i < kPackets; ++i) packets::pstoreu(to + i * kPacket, lanes.packet[i]);
}

void add_product(const Lanes& a, const Lanes& b, Lanes& sum) {
  for (int i = 0; i < kPackets; ++i) sum.packet[i] = packets::pmadd(a.packet[i], b.packet[i], sum.packet[i]);
}

// One half onto the other until one lane is left.
float total(Lanes lanes) {
  for (int half = kPackets / 2; half > 0; half /= 2)
    for (int i = 0; i < half; ++i) lanes.packet[i] = packets::padd(lanes.packet[i], lanes.packet[half + i]);
  return packets::predux(lanes.packet[0]);
}

#ifdef __AVX512F__
constexpr int kAtOnce = 8;
#else
constexpr int kAtOnce = 6;  // rows whose sums fit into the registers
#endif

// y += W x for Rows rows. The columns that fill no lanes come one after another. Eight of them round their products
// first: so did the rows that were published before the order was written out.
template <int Rows>
void add_rows(int cols, const float* W, const float* x, float* y) {
  Lanes sums[Rows];
  for (Lanes& lanes : sums) lanes = zeros();
  int c = 0;
  for (; c + kLanes <= cols; c += kLanes) {
    const Lanes value = load(x + c);
    for (int r = 0; r < Rows; ++r) add_product(load(W + std::ptrdiff_t{r} * cols + c), value, sums[r]);
  }
  float totals[Rows];
  for (int r = 0; r < Rows; ++r) totals[r] = total(sums[r]);
  const int rounded = cols - c >= kLanes / 2 ? c + kLanes / 2 : c;
  for (; c < rounded; ++c)
    for (int r = 0; r < Rows; ++r) totals[r] += W[std::ptrdiff_t{r} * cols + c] * x[c];
  for (; c < cols; ++c)
    for (int r = 0; r < Rows; ++r) totals[r] = fused(W[std::ptrdiff_t{r} * cols + c], x[c], totals[r]);
  for (int r = 0; r < Rows; ++r) y[r] += totals[r];
}

void gemv(int rows, int cols, const float* W, const float* x, const float* b, float* y) {
  if (b != nullptr)
    std::memmove(y, b, static_cast<std::size_t>(rows) * sizeof(float));
  else
    std::memset(y, 0, static_cast<std::size_t>(rows) * sizeof(float));
  int row = 0;
  for (; row + kAtOnce <= rows; row += kAtOnce) add_rows<kAtOnce>(cols, W + std::ptrdiff_t{row} * cols, x, y + row);
  for (; row < rows; ++row) add_rows<1>(cols, W + std::ptrdiff_t{row} * cols, x, y + row);
}

using Vector = Eigen::Matrix<float, Eigen::Dynamic, 1>;

// gemm goes by tiles of kTall rows and kAcross columns, whose sums stay in registers; each adds its k terms in order.
#ifdef __AVX512F__
constexpr int kHigh = 2, kAcross = 12;
#else
constexpr int kHigh = 1, kAcross = 6;
#endif
constexpr int kTall = kLanes * kHigh;

constexpr int smaller(int a, int b) { return a < b ? a : b; }

// left: (k, kTall) and right: (k, kAcross), row by row; tile: (kAcross, kTall).
void multiply_tile(int k, const float* left, const float* right, float* tile) {
  Lanes sums[kAcross * kHigh];
  for (Lanes& lanes : sums) lanes = zeros();
  for (int l = 0; l < k; ++l, left += kTall, right += kAcross) {
    Lanes column[kHigh];
    for (int h = 0; h < kHigh; ++h) column[h] = load(left + h * kLanes);
#pragma GCC unroll 12
    for (int j = 0; j < kAcross; ++j) {
      const Packet factor = packets::pset1<Packet>(right[j]);
      for (int h = 0; h < kHigh; ++h)
        for (int i = 0; i < kPackets; ++i) {
          Packet& sum = sums[j * kHigh + h].packet[i];
          sum = packets::pmadd(column[h].packet[i], factor, sum);
        }
    }
  }
  for (int i = 0; i < kAcross * kHigh; ++i) store(sums[i], tile + i * kLanes);
}

// Copies rows i < count of a matrix whose entry (i, l) is from[i along + l across] into panel (k, width); the rest of
// it is zero.
void pack(const float* from, std::ptrdiff_t along, std::ptrdiff_t across, int count, int width, int k, float* panel) {
  for (int l = 0; l < k; ++l, from += across, panel += width) {
    for (int i = 0; i < count; ++i) panel[i] = from[i * along];
    for (int i = count; i < width; ++i) panel[i] = 0.0F;
  }
}

void gemm(bool transpose_a, bool transpose_b, int m, int n, int k, const float* A, const float* B, float* C,
          bool accumulate) {
  const std::ptrdiff_t a_along = transpose_a ? k : 1, a_across = transpose_a ? 1 : m;
  const std::ptrdiff_t b_along = transpose_b ? 1 : k, b_across = transpose_b ? n : 1;
  const std::ptrdiff_t panel = std::ptrdiff_t{kAcross} * k;
  const int panels = (n + kAcross - 1) / kAcross;
  Vector left(std::ptrdiff_t{kTall} * k), right(panels * panel);
  for (int p = 0; p < panels; ++p)
    pack(B + p * kAcross * b_along, b_along, b_across, smaller(kAcross, n - p * kAcross), kAcross, k,
         right.data() + p * panel);
  for (int row = 0; row < m; row += kTall) {
    const int tall = smaller(kTall, m - row);
    pack(A + row * a_along, a_along, a_across, tall, kTall, k, left.data());
    for (int p = 0; p < panels; ++p) {
      float tile[kAcross * kTall];
      multiply_tile(k, left.data(), right.data() + p * panel, tile);
      for (int j = 0; j < smaller(kAcross, n - p * kAcross); ++j) {
        float* c = C + std::ptrdiff_t{p * kAcross + j} * m + row;
        for (int i = 0; i < tall; ++i) c[i] = (accumulate ? c[i] : 0.0F) + tile[j * kTall + i];
      }
    }
  }
}

// kHalfColumns numbers in half precision as floats. Eigen's cast is not vectorised.
Lanes widen(const std::uint16_t* halves) {
#if defined(__AVX512F__)
  return {{_mm512_cvtph_ps(_mm256_loadu_si256(reinterpret_cast<const __m256i*>(halves)))}};
#elif defined(__F16C__)
  return {{_mm256_cvtph_ps(_mm_loadu_si128(reinterpret_cast<const __m128i*>(halves))),
           _mm256_cvtph_ps(_mm_loadu_si128(reinterpret_cast<const __m128i*>(halves + kPacket)))}};
#else
  float wide[kLanes];
  for (int i = 0; i < kLanes; ++i) {
    Eigen::half half;
    half.x = halves[i];
    wide[i] = static_cast<float>(half);
  }
  return load(wide);
#endif
}

// Four rows at a time, whose sums do not wait for each other; what is read is one stream.
void gemv_half(int rows, int cols, const std::uint16_t* W, const float* x, const float* b, float* y) {
  constexpr int kAhead = 1024, kLine = 32;  // halves
  for (int row = 0; row < rows; row += kHalfRows) {
    Lanes sums[kHalfRows];
    for (Lanes& lanes : sums) lanes = zeros();
    for (int c = 0; c < cols; c += kHalfColumns) {
      __builtin_prefetch(W + kAhead);
      __builtin_prefetch(W + kAhead + kLine);
      const Lanes value = load(x + c);
      for (Lanes& lanes : sums) {
        add_product(widen(W), value, lanes);
        W += kHalfColumns;
      }
    }
    for (int i = 0; i < kHalfRows && row + i < rows; ++i)
      y[row + i] = total(sums[i]) + (b != nullptr ? b[row + i] : 0.0F);
  }
}

// e^x for x <= 0 to one unit in the last place, or NaN: 2^m e^r with |r| <= ln(2) / 2 and the polynomial of Cephes.
float exp_of_negative(float x) {
  const float bound = x < -88.0F ? -88.0F : x;
  const float m = __builtin_floorf(fused(bound, 1.44269504088896341F, 0.5F));
  const float r = fused(m, -0.6931471805599453F, bound), r2 = r * r;
  const float high = fused(fused(1.9875691500E-4F, r, 1.3981999507E-3F), r, 8.3334519073E-3F);
  const float low = fused(fused(4.1665795894E-2F, r, 1.6666665459E-1F), r, 5.0000001201E-1F);
  const float y = fused(fused(high, r2 * r, low), r2, r + 1.0F);
  const std::int32_t exponent = m == m ? static_cast<std::int32_t>(m + 127.0F) << 23 : 0;
  return y * __builtin_bit_cast(float, exponent);
}

// The sum of the positive and the negative part, so that it is vectorised. NaN stays NaN.
void elu(int n, float* x) {
  for (int i = 0; i < n; ++i) {
    const float a = x[i];
    x[i] = (a < 0.0F ? 0.0F : a) + (exp_of_negative(a > 0.0F ? 0.0F : a) - 1.0F);
  }
}

void elu_backward(int n, const float* a, float* d) {
  for (int i = 0; i < n; ++i) d[i] *= (a[i] > 0.0F ? 0.0F : a[i]) + 1.0F;
}

void adam(int n, const float* g, float scale, float step, float correction, float* m, float* v, float* p) {
  constexpr float kBeta1 = 0.9F, kBeta2 = 0.999F, kEpsilon = 1e-8F;
  for (int i = 0; i < n; ++i) {
    const float gradient = scale * g[i];
    m[i] = fused(kBeta1, m[i], (1.0F - kBeta1) * gradient);
    v[i] = fused(kBeta2, v[i], (1.0F - kBeta2) * (gradient * gradient));
    p[i] -= step * m[i] / (__builtin_sqrtf(v[i] / correction) + kEpsilon);
  }
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
