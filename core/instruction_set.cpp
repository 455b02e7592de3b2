#include "duet/core/instruction_set.h"

namespace duet {
namespace {

#if defined(__x86_64__)
bool has_avx2() {
  return __builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma") && __builtin_cpu_supports("bmi") &&
         __builtin_cpu_supports("bmi2");
}

bool has_avx512() {
  return __builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512bw") &&
         __builtin_cpu_supports("avx512cd") && __builtin_cpu_supports("avx512dq") && __builtin_cpu_supports("avx512vl");
}
#endif

}  // namespace

std::string_view to_string(InstructionSet set) {
  switch (set) {
    case InstructionSet::kV4:
      return "x86-64-v4";
    case InstructionSet::kV3:
      return "x86-64-v3";
    case InstructionSet::kV2:
      return "x86-64-v2";
    default:
      return "portable";
  }
}

bool runs_here([[maybe_unused]] InstructionSet set) {
#if defined(__x86_64__)
  __builtin_cpu_init();
  switch (set) {
    case InstructionSet::kV4:
      return has_avx2() && has_avx512();
    case InstructionSet::kV3:
      return has_avx2();
    default:
      return true;  // all of duet is compiled for x86-64-v2
  }
#else
  return set == InstructionSet::kPortable;
#endif
}

}  // namespace duet
