#include "duet/backends/simbody/simbody_options.h"

#include <array>

namespace duet {

std::span<const EngineOption> simbody_options() {
  static const std::array<EngineOption, 4> options = {
      number_option("contact_stiffness", 5e5, 1e3, 1e9, "spring of a contact point on the ground or a link [N/m]"),
      number_option("contact_damping", 1e4, 0.0, 1e6, "its damper [N s/m]"),
      number_option("stop_erp", 0.2, 0.0, 1.0, "share of a passed joint stop that one step removes"),
      integer_option("sweeps", 60, 1, 10000, "most sweeps of the contact solver where contacts slide or open")};
  return options;
}

SimbodySettings simbody_settings(const EngineOptions& options) {
  const std::span<const EngineOption> known = simbody_options();
  check_options("simbody", options, known);
  return {.contact_stiffness = option_number(options, known, "contact_stiffness"),
          .contact_damping = option_number(options, known, "contact_damping"),
          .stop_erp = option_number(options, known, "stop_erp"),
          .sweeps = option_integer(options, known, "sweeps")};
}

}  // namespace duet
