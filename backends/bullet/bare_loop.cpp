#include "duet/backends/bullet/bare_loop.h"

#include "duet/backends/bullet/bullet_world.h"
#include "duet/backends/physics_backend.h"
#include "duet/core/require.h"

namespace duet {

double bullet_bare_step_seconds(const Scene& scene, const RobotState& state, const JointCommand& command, int steps) {
  require(steps >= 1, "bullet_bare_step_seconds: steps is {}, expected >= 1", steps);
  NarrowPhase narrow_phase(scene);
  BulletWorld world(scene, narrow_phase.capacity());
  world.articulation().write(state);
  RobotState read = state;
  Eigen::VectorXd torques = Eigen::VectorXd::Zero(scene.robot->dof());
  const double begin = thread_cpu_seconds();
  for (int step = 0; step < steps; ++step) {
    if (!world.begin(read, command)) break;
    world.step(narrow_phase.collide(world.kinematics(), {}), nullptr, read, torques);
  }
  return thread_cpu_seconds() - begin;
}

}  // namespace duet
