// JSON that nests deeper than a stack holds: what went through it by recursion ended the program.
#pragma once

#include <string>

namespace duet::test {

inline std::string deep_json(std::size_t depth = 200'000) { return std::string(depth, '[') + std::string(depth, ']'); }

inline constexpr const char* kTooDeep = "expected JSON of at most 64 levels, found one that is deeper";

}  // namespace duet::test
