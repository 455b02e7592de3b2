#include "duet/training/dstar/torch/blas.h"

#include <dlfcn.h>
#include <torch/torch.h>

#include <filesystem>

#include "duet/training/dstar/trainer.h"

namespace duet {

void one_thread_each() {
  torch::set_num_threads(1);
  using SetThreads = void (*)(int);
  if (auto* set = reinterpret_cast<SetThreads>(dlsym(RTLD_DEFAULT, "openblas_set_num_threads"))) set(1);
}

std::string training_blas() {
  Dl_info info{};
  void* gemm = dlsym(RTLD_DEFAULT, "sgemm_");
  if (gemm == nullptr || dladdr(gemm, &info) == 0 || info.dli_fname == nullptr) return "unknown";
  return std::filesystem::weakly_canonical(info.dli_fname).filename().string() +
         (dlsym(RTLD_DEFAULT, "openblas_set_num_threads") != nullptr ? " (OpenBLAS)" : " (the slow reference BLAS)");
}

}  // namespace duet
