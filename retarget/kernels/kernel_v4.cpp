// The PAIR kernel for AVX-512. Compiled with -march=x86-64-v4 (retarget/CMakeLists.txt); chosen at run time.
#include <immintrin.h>

#include "duet/retarget/kernels/kernel_types.h"

namespace duet::pair_kernel {
namespace {

constexpr int kWidth = 16;
typedef float V __attribute__((vector_size(4 * kWidth)));
typedef int VI __attribute__((vector_size(4 * kWidth)));

inline V square_root(V x) { return _mm512_maskz_sqrt_ps(0xffff, x); }
inline bool any(VI x) { return _mm512_movepi32_mask(reinterpret_cast<__m512i>(x)) != 0; }

}  // namespace
}  // namespace duet::pair_kernel

#include "duet/retarget/kernels/kernel_body.h"
#include "duet/retarget/kernels/lbfgs_body.h"

namespace duet::pair_kernel {

const LaneKernel kV4 = kKernel;

}  // namespace duet::pair_kernel
