// The kernels of PAIR and which of them this processor runs.
#pragma once

#include <string_view>
#include <vector>

#include "duet/retarget/options.h"

namespace duet {

// Kernels that run here, best first, scalar last. kPortable is always there.
std::vector<KernelKind> available_kernels();
std::string_view to_string(KernelKind kernel);  // "auto", "scalar", "portable", "v2", "v3" (AVX2), "v4" (AVX-512)

bool kernel_runs_here(KernelKind kernel);

}  // namespace duet
