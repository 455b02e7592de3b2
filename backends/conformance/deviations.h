// Where engines are known to miss a tolerance of the conformance suite: one table, each entry with its reason and with
// a bound that still holds. An entry that no longer deviates is as wrong as a missing one (stale_deviations).
#pragma once

#include <span>
#include <string_view>

#include "duet/backends/conformance/conformance.h"

namespace duet::conformance {

struct Deviation {
  std::string_view engine, scene;
  std::string_view quantity;  // or how several of them begin
  std::string_view reason;
  double bound = 0.0;             // error_of() stays at or below
  Effort shows = Effort::kQuick;  // kFull: only the smaller or larger steps of full effort show it
};

std::span<const Deviation> deviations();
const Deviation* find_deviation(std::string_view engine, std::string_view scene, std::string_view quantity);

}  // namespace duet::conformance
