#include "duet/backends/conformance/deviations.h"

#include <algorithm>

#include "duet/backends/factory.h"

namespace duet::conformance {

std::span<const EngineDeviation> deviations(const std::string& engine) {
  const EngineModule* module = find_engine_module(engine);
  return module == nullptr ? std::span<const EngineDeviation>() : module->deviations;
}

const EngineDeviation* find_deviation(const std::string& engine, std::string_view scene, std::string_view quantity) {
  const std::span<const EngineDeviation> known = deviations(engine);
  const auto found = std::ranges::find_if(known, [&](const EngineDeviation& entry) {
    return entry.scene == scene && quantity.starts_with(entry.quantity);
  });
  return found == known.end() ? nullptr : &*found;
}

}  // namespace duet::conformance
