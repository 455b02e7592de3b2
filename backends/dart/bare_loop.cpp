#include "duet/backends/dart/bare_loop.h"

#include "duet/backends/dart/dart_world.h"
#include "duet/backends/physics_backend.h"
#include "duet/core/require.h"

namespace duet {

double dart_bare_step_seconds(const Scene& scene, const RobotState& state, const JointCommand& command, int steps) {
  require(steps >= 1, "dart_bare_step_seconds: steps is {}, expected >= 1", steps);
  NarrowPhase narrow_phase(scene);
  DartWorld world(scene, narrow_phase.capacity());
  world.write_state(state);
  const MovingPartner nobody;
  std::vector<Eigen::Matrix3d> R_WL(scene.robot->links.size());
  std::vector<Eigen::Vector3d> p_WL(scene.robot->links.size());
  RobotState read = state;
  const double begin = thread_cpu_seconds();
  for (int step = 0; step < steps; ++step) {
    world.read_poses(R_WL, p_WL);
    if (!world.step(command, read, narrow_phase.collide(R_WL, p_WL, nobody))) break;
    world.read_state(read);
  }
  return thread_cpu_seconds() - begin;
}

}  // namespace duet
