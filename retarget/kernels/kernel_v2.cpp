// The PAIR kernel for any x86-64-v2 processor. Compiled with -march=x86-64-v2 (retarget/CMakeLists.txt); chosen at run
// time.
#include <immintrin.h>

#include "duet/retarget/kernels/kernel_types.h"

namespace duet::pair_kernel {
namespace {

constexpr int kWidth = 4;
typedef float V __attribute__((vector_size(4 * kWidth)));
typedef int VI __attribute__((vector_size(4 * kWidth)));

inline V square_root(V x) { return _mm_sqrt_ps(x); }
inline bool any(VI x) { return _mm_movemask_ps(reinterpret_cast<__m128>(x)) != 0; }

}  // namespace
}  // namespace duet::pair_kernel

#include "duet/retarget/kernels/kernel_body.h"
#include "duet/retarget/kernels/lbfgs_body.h"

namespace duet::pair_kernel {

const LaneKernel kV2 = kKernel;

}  // namespace duet::pair_kernel
