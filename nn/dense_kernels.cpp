#include "duet/nn/dense_kernels.h"

#include <array>
#include <string>

#include "duet/core/require.h"

namespace duet {

extern const DenseKernels kDenseKernelsV2, kDenseKernelsV3, kDenseKernelsV4;

namespace {

bool runs_here(const DenseKernels& kernels) {
  __builtin_cpu_init();
  if (&kernels == &kDenseKernelsV4)
    return __builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512bw") &&
           __builtin_cpu_supports("avx512dq") && __builtin_cpu_supports("avx512vl") &&
           __builtin_cpu_supports("avx512cd");
  if (&kernels == &kDenseKernelsV3)
    return __builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma") && __builtin_cpu_supports("bmi") &&
           __builtin_cpu_supports("bmi2");
  return true;
}

const std::array<const DenseKernels*, 3> kWidestFirst = {&kDenseKernelsV4, &kDenseKernelsV3, &kDenseKernelsV2};

const DenseKernels& widest() {
  for (const DenseKernels* kernels : kWidestFirst)
    if (runs_here(*kernels)) return *kernels;
  return kDenseKernelsV2;
}

}  // namespace

const DenseKernels& dense_kernels() {
  static const DenseKernels& chosen = widest();
  return chosen;
}

const DenseKernels& dense_kernels(std::string_view level) {
  for (const DenseKernels* kernels : kWidestFirst)
    if (kernels->level == level && runs_here(*kernels)) return *kernels;
  throw std::invalid_argument("dense kernels: '" + std::string(level) +
                              "' is not one of x86-64-v2, x86-64-v3, x86-64-v4 or not of this machine");
}

}  // namespace duet
