#include "duet/backends/mujoco/bare_loop.h"

#include <mujoco/mujoco.h>

#include "duet/backends/mujoco/mujoco_law.h"
#include "duet/backends/mujoco/mujoco_model.h"
#include "duet/backends/physics_backend.h"
#include "duet/core/require.h"

namespace duet {

double mujoco_bare_step_seconds(const Scene& scene, const RobotState& state, const JointCommand& command, int steps) {
  require(steps >= 1, "mujoco_bare_step_seconds: steps is {}, expected >= 1", steps);
  MujocoModel compiled = compile_mujoco(scene);
  mjModel& m = *compiled.model;
  mjData& d = *compiled.data;
  write_state(state, compiled, d);
  MujocoLaw law(scene, compiled);
  RobotState read = state;
  const double begin = thread_cpu_seconds();
  for (int step = 0; step < steps; ++step) {
    law.begin(read, command);
    mj_step1(&m, &d);
    law.accelerate();
    law.integrate();
    read_state(compiled, read);
  }
  return thread_cpu_seconds() - begin;
}

}  // namespace duet
