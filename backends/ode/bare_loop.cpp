#include "duet/backends/ode/bare_loop.h"

#include "duet/backends/ode/ode_stepper.h"
#include "duet/backends/ode/ode_world.h"
#include "duet/backends/physics_backend.h"
#include "duet/core/require.h"

namespace duet {

double ode_bare_step_seconds(const Scene& scene, const RobotState& state, const JointCommand& command, int steps) {
  require(steps >= 1, "ode_bare_step_seconds: steps is {}, expected >= 1", steps);
  enter_ode();
  NarrowPhase narrow_phase(scene);
  OdeStepper stepper(scene, narrow_phase.capacity());
  stepper.world().place(state);
  const MovingPartner nobody;
  RobotState read = state;
  const double begin = thread_cpu_seconds();
  for (int step = 0; step < steps; ++step) {
    const std::span<const ContactPoint> points =
        narrow_phase.collide(stepper.world().rotations(), stepper.world().positions(), nobody);
    stepper.advance(command, points, nullptr, read);
  }
  return thread_cpu_seconds() - begin;
}

}  // namespace duet
