#include "duet/retarget/kernels/kernels.h"

#include "duet/core/machine.h"

namespace duet {

bool kernel_runs_here(KernelKind kernel) {
  switch (kernel) {
    case KernelKind::kV4:
      return runs_here(InstructionSet::kV4);
    case KernelKind::kV3:
      return runs_here(InstructionSet::kV3);
    case KernelKind::kV2:
      return runs_here(InstructionSet::kV2);
    default:
      return true;
  }
}

std::vector<KernelKind> available_kernels() {
  std::vector<KernelKind> kernels;
  for (const KernelKind kind : {KernelKind::kV4, KernelKind::kV3, KernelKind::kV2, KernelKind::kPortable}) {
    if (kernel_runs_here(kind)) kernels.push_back(kind);
  }
  kernels.push_back(KernelKind::kScalar);
  return kernels;
}

std::string_view to_string(KernelKind kernel) {
  switch (kernel) {
    case KernelKind::kScalar:
      return "scalar";
    case KernelKind::kPortable:
      return "portable";
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
