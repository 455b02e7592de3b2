#include "backends/ode/bare_loop.h"

#include <fmt/format.h>

#include <ctime>

#include "backends/ode/ode_library.h"
#include "backends/ode/ode_stepper.h"
#include "core/require.h"

namespace duet {
namespace {

double cpu_seconds() {
  timespec now{};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
  return static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec);
}

}  // namespace

double ode_bare_step_seconds(const Scene& scene, const RobotState& state, const JointCommand& command, int steps) {
  require(steps >= 1, fmt::format("ode_bare_step_seconds: steps is {}, expected >= 1", steps));
  enter_ode();
  NarrowPhase narrow_phase(scene);
  OdeStepper stepper(scene, narrow_phase.capacity());
  stepper.world().place(state);
  const MovingPartner nobody;
  RobotState read = state;
  const double begin = cpu_seconds();
  for (int step = 0; step < steps; ++step) {
    const std::span<const ContactPoint> points =
        narrow_phase.collide(stepper.world().rotations(), stepper.world().positions(), nobody);
    stepper.advance(command, points, nullptr, read);
  }
  return cpu_seconds() - begin;
}

}  // namespace duet
