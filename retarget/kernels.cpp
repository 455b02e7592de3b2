#include "duet/retarget/kernels.h"

namespace duet {

bool kernel_runs_here(KernelKind kernel) {
  switch (kernel) {
    case KernelKind::kV4:
      return __builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512bw") &&
             __builtin_cpu_supports("avx512cd") && __builtin_cpu_supports("avx512dq") &&
             __builtin_cpu_supports("avx512vl") && kernel_runs_here(KernelKind::kV3);
    case KernelKind::kV3:
      return __builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma") && __builtin_cpu_supports("bmi") &&
             __builtin_cpu_supports("bmi2");
    default:
      return true;
  }
}

std::vector<KernelKind> available_kernels() {
  std::vector<KernelKind> kernels;
  for (const KernelKind kind : {KernelKind::kV4, KernelKind::kV3, KernelKind::kV2}) {
    if (kernel_runs_here(kind)) kernels.push_back(kind);
  }
  kernels.push_back(KernelKind::kScalar);
  return kernels;
}

std::string_view to_string(KernelKind kernel) {
  switch (kernel) {
    case KernelKind::kScalar:
      return "scalar";
    case KernelKind::kV2:
      return "v2";
    case KernelKind::kV3:
      return "v3";
    case KernelKind::kV4:
      return "v4";
    default:
      return "auto";
  }
}

}  // namespace duet
