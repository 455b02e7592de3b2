// The PAIR kernel for any x86-64-v2 processor. Compiled with -march=x86-64-v2 (retarget/CMakeLists.txt); chosen at run
// time.
#include <immintrin.h>

#include "retarget/kernel_types.h"

namespace duet::pair_kernel {
namespace {

constexpr int kWidth = 4;
typedef float V __attribute__((vector_size(4 * kWidth)));
typedef int VI __attribute__((vector_size(4 * kWidth)));

inline V square_root(V x) { return _mm_sqrt_ps(x); }

}  // namespace
}  // namespace duet::pair_kernel

#include "retarget/kernel_body.h"

namespace duet::pair_kernel {

void sweep_v2(const Sweep& sweep) { sweep_blocks(sweep); }

}  // namespace duet::pair_kernel
