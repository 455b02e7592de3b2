#include "duet/nn/dense_kernels.h"

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

}  // namespace duet
