#include "backends/simbody/bare_loop.h"

#include <fmt/format.h>

#include <ctime>

#include "backends/simbody/simbody_stepper.h"
#include "core/require.h"

namespace duet {
namespace {

double cpu_seconds() {
  timespec now{};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
  return static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec);
}

}  // namespace

double simbody_bare_step_seconds(const Scene& scene, const RobotState& state, const JointCommand& command, int steps) {
  require(steps >= 1, fmt::format("simbody_bare_step_seconds: steps is {}, expected >= 1", steps));
  SimbodyStepper stepper(scene);
  NarrowPhase narrow_phase(scene);
  const LinkPushes no_pushes(scene.robot->links.size());
  RobotState moving = state;
  const double begin = cpu_seconds();
  for (int step = 0; step < steps; ++step) stepper.step(moving, command, no_pushes, {}, narrow_phase);
  return cpu_seconds() - begin;
}

}  // namespace duet
