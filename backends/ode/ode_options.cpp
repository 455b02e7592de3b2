#include "duet/backends/ode/ode_options.h"

#include <vector>

namespace duet {

std::span<const EngineOption> ode_option_table() {
  static const std::vector<EngineOption> table = {
      number_option("joint_erp", 0.8, 0.0, 1.0, "share of a hinge's drift that a step removes"),
      number_option("joint_cfm", 0.0, 0.0, 1.0, "compliance of hinges [m/(N s)]"),
      number_option("stop_erp", 0.2, 0.0, 1.0, "share of what a joint has passed its stop by that a step removes"),
      number_option("stop_cfm", 1e-9, 0.0, 1.0, "compliance of joint stops [rad/(N m s)]"),
      number_option("contact_erp", 0.2, 0.0, 1.0, "share of the depth of a rigid contact that a step removes"),
      number_option("contact_cfm", 1e-8, 1e-12, 1.0, "compliance of rigid contacts and of friction [m/(N s)]"),
      choice_option("friction", {"active", "bounded"},
                    "active: contacts foreseen to stick have no bound on friction; a step that then breaks one is "
                    "repeated with all bounds. bounded: all bounds in every step"),
      integer_option("sweeps", 100, 1, 10000, "of Gauss-Seidel where the forecast of ODE's forces does not settle")};
  return table;
}

OdeOptions ode_options(const EngineOptions& options) {
  const std::span<const EngineOption> known = ode_option_table();
  check_options("ode", options, known);
  const auto softness = [&](const std::string& of) {
    return Softness{.erp = option_number(options, known, of + "_erp"),
                    .cfm = option_number(options, known, of + "_cfm")};
  };
  return {.joint = softness("joint"),
          .stop = softness("stop"),
          .contact = softness("contact"),
          .stick = option_choice(options, known, "friction") == "active",
          .sweeps = option_integer(options, known, "sweeps")};
}

}  // namespace duet
