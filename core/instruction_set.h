// Instruction sets that kernel files (PAIR, dense layers) are compiled for, and which of them this processor has.
// Thread-safe.
#pragma once

#include <string_view>

namespace duet {

// Any processor | x86-64-v2 (SSE4.2), x86-64-v3 (AVX2 with FMA), x86-64-v4 (AVX-512). Each x86 set includes those
// before.
enum class InstructionSet { kPortable, kV2, kV3, kV4 };

std::string_view to_string(InstructionSet set);  // "portable", "x86-64-v2", "x86-64-v3", "x86-64-v4"
// Whether code compiled for `set` may be called here. kPortable always may; the others on x86-64 only.
bool runs_here(InstructionSet set);

}  // namespace duet
