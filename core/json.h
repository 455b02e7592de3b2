// The one door through which JSON comes in and goes out. Thread-safe.
#pragma once

#include <nlohmann/json_fwd.hpp>
#include <string>
#include <string_view>

namespace duet {

// Our own documents nest 6 deep. Writing, comparing and destroying a value go down its levels by recursion, so that a
// file that nests without end would end the program.
inline constexpr int kMostJsonDepth = 64;

// Throws InputError that begins with `what` ("golden baseline", "run.json") for text that is not JSON, that nests
// deeper than kMostJsonDepth, that holds a number which no double is, or an object with a key twice (two readers could
// take one and the other).
nlohmann::json parse_json(std::string_view text, const std::string& what);

// As text, the only door out: json::dump() throws for bytes that are no valid UTF-8 (a file's name, an engine's
// message), which become one replacement character here. `indent`: -1 for one line.
std::string dumped(const nlohmann::json& json, int indent = -1);
std::string dumped(const nlohmann::ordered_json& json, int indent = -1);

}  // namespace duet
