#include "duet/backends/mujoco/mujoco_options.h"

namespace duet {

std::span<const EngineOption> mujoco_options() {
  static const std::vector<EngineOption> options = {
      choice_option("solver", {"newton", "cg", "pgs"}, "of the constraint forces"),
      integer_option("iterations", 20, 1, 1000, "of the solver, at most"),
      number_option("tolerance", 1e-8, 0.0, 1.0, "of the solver: scaled improvement at which it ends"),
      choice_option("cone", {"elliptic", "pyramidal"}, "friction cone"),
      number_option("impratio", 10.0, 1.0, 1e4, "stiffness of friction over that of the normal"),
      choice_option("jacobian", {"dense", "sparse"}, "form of the solver's matrices; pgs is always dense"),
      choice_option("integrator", {"euler", "implicit"},
                    "implicit also takes velocity-product forces at the end of the step"),
      number_option("ground_time_constant", 0.01, 1e-4, 0.1,
                    "of contacts with the ground and the robot itself, at least two steps [s]")};
  return options;
}

MujocoSettings mujoco_settings(const EngineOptions& options) {
  const std::span<const EngineOption> known = mujoco_options();
  MujocoSettings settings;
  settings.solver = option_choice(options, known, "solver");
  settings.cone = option_choice(options, known, "cone");
  settings.jacobian = settings.solver == "pgs" ? "dense" : option_choice(options, known, "jacobian");
  settings.integrator = option_choice(options, known, "integrator");
  settings.iterations = option_integer(options, known, "iterations");
  settings.tolerance = option_number(options, known, "tolerance");
  settings.impratio = option_number(options, known, "impratio");
  settings.ground_time_constant = option_number(options, known, "ground_time_constant");
  return settings;
}

}  // namespace duet
