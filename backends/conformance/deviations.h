// Known deviations of engines, by name of the engine (backends/engine_deviation.h).
#pragma once

#include <span>
#include <string>
#include <string_view>

#include "duet/backends/engine_deviation.h"

namespace duet::conformance {

// The deviations that the engine's module states; none for an engine that is not there.
std::span<const EngineDeviation> deviations(const std::string& engine);
const EngineDeviation* find_deviation(const std::string& engine, std::string_view scene, std::string_view quantity);

}  // namespace duet::conformance
