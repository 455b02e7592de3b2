// The PAIR kernel for AVX2 with FMA. Compiled with -march=x86-64-v3 (retarget/CMakeLists.txt); chosen at run time.
#include <immintrin.h>

#include "duet/retarget/kernel_types.h"

namespace duet::pair_kernel {
namespace {

constexpr int kWidth = 8;
typedef float V __attribute__((vector_size(4 * kWidth)));
typedef int VI __attribute__((vector_size(4 * kWidth)));

inline V square_root(V x) { return _mm256_sqrt_ps(x); }
inline bool any(VI x) { return _mm256_movemask_ps(reinterpret_cast<__m256>(x)) != 0; }

}  // namespace
}  // namespace duet::pair_kernel

#include "duet/retarget/kernel_body.h"
#include "duet/retarget/lbfgs_body.h"

namespace duet::pair_kernel {

void sweep_v3(const Sweep& sweep) { sweep_blocks(sweep); }
void filter_gradient_v3(const VectorSweep& at, const Row* x, const Row* gradient, Row* out) {
  filter_gradient(at, x, gradient, out);
}
void step_v3(const VectorSweep& at, const Row* x0, const Row* x1, const Row* g0, const Row* g1, Row* s, Row* y) {
  step(at, x0, x1, g0, g1, s, y);
}
void dots_v3(const VectorSweep& at, const Row* const* vectors, int count, int newest, const Row* g, Row* sums) {
  dots(at, vectors, count, newest, g, sums);
}
void combine_v3(const VectorSweep& at, const Row* const* vectors, const float* factors, int count, Row* out) {
  combine(at, vectors, factors, count, out);
}
void move_v3(const VectorSweep& at, const Row* x, const Row* direction, float rate, float turn, Row* next) {
  move(at, x, direction, rate, turn, next);
}

}  // namespace duet::pair_kernel
