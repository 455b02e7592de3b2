// The PAIR kernel for any processor, in C++ with the vector types that GCC and Clang have; chosen at run time.
#include <cmath>

#include "duet/retarget/kernels/kernel_types.h"

namespace duet::pair_kernel {
namespace {

constexpr int kWidth = 4;
typedef float V __attribute__((vector_size(4 * kWidth)));
typedef int VI __attribute__((vector_size(4 * kWidth)));

inline V square_root(V x) { return V{std::sqrt(x[0]), std::sqrt(x[1]), std::sqrt(x[2]), std::sqrt(x[3])}; }
inline bool any(VI x) { return (x[0] | x[1] | x[2] | x[3]) != 0; }

}  // namespace
}  // namespace duet::pair_kernel

#include "duet/retarget/kernels/kernel_body.h"
#include "duet/retarget/kernels/lbfgs_body.h"

namespace duet::pair_kernel {

const LaneKernel kPortable = kKernel;

}  // namespace duet::pair_kernel
