// The PAIR kernel for AVX2 with FMA. Compiled with -march=x86-64-v3 (retarget/CMakeLists.txt); chosen at run time.
#include <immintrin.h>

#include "duet/retarget/kernels/kernel_types.h"

namespace duet::pair_kernel {
namespace {

constexpr int kWidth = 8;
typedef float V __attribute__((vector_size(4 * kWidth)));
typedef int VI __attribute__((vector_size(4 * kWidth)));

inline V square_root(V x) { return _mm256_sqrt_ps(x); }
inline bool any(VI x) { return _mm256_movemask_ps(reinterpret_cast<__m256>(x)) != 0; }

}  // namespace
}  // namespace duet::pair_kernel

#include "duet/retarget/kernels/kernel_body.h"
#include "duet/retarget/kernels/lbfgs_body.h"

namespace duet::pair_kernel {

const LaneKernel kV3 = kKernel;

}  // namespace duet::pair_kernel
