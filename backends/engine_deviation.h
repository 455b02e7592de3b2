// Where an engine is known to miss a tolerance of the conformance suite: an entry of its module, with its reason and
// with a bound that still holds. An entry that no longer deviates is as wrong as a missing one
// (conformance::stale_deviations).
#pragma once

#include <string_view>

namespace duet {

struct EngineDeviation {
  std::string_view scene;
  std::string_view quantity;  // or how several of them begin
  std::string_view reason;
  double bound = 0.0;                // error_of() stays at or below, on the robot that stands in
  bool only_at_full_effort = false;  // only the smaller or larger steps of full effort show it
};

}  // namespace duet
