// How an episode or a step ended. Outcomes are values: they are counted as failures, shown, never dropped.
#pragma once

#include <string_view>

namespace duet {

enum class Outcome { kOk, kFell, kDiverged, kTimedOut, kUnsupported, kError };

// "ok", "fell", "diverged", "timeout", "unsupported", "error".
std::string_view to_string(Outcome outcome);
// Throws std::invalid_argument for an unknown name.
Outcome parse_outcome(std::string_view name);

}  // namespace duet
