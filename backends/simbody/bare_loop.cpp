#include "duet/backends/simbody/bare_loop.h"

#include "duet/backends/physics_backend.h"
#include "duet/backends/simbody/simbody_stepper.h"
#include "duet/core/require.h"

namespace duet {

double simbody_bare_step_seconds(const Scene& scene, const RobotState& state, const JointCommand& command, int steps) {
  require(steps >= 1, "simbody_bare_step_seconds: steps is {}, expected >= 1", steps);
  NarrowPhase narrow_phase(scene);
  SimbodyStepper stepper(scene, narrow_phase.capacity());
  const ExternalForces no_pushes(scene.robot->links.size());
  RobotState moving = state;
  const double begin = thread_cpu_seconds();
  for (int step = 0; step < steps; ++step)
    if (!stepper.step(moving, command, no_pushes, {}, narrow_phase)) break;
  return thread_cpu_seconds() - begin;
}

}  // namespace duet
