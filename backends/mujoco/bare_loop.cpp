#include "backends/mujoco/bare_loop.h"

#include <fmt/format.h>
#include <mujoco/mujoco.h>

#include <algorithm>
#include <ctime>

#include "backends/mujoco/mujoco_model.h"
#include "core/require.h"

namespace duet {
namespace {

double cpu_seconds() {
  timespec now{};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
  return static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec);
}

}  // namespace

double mujoco_bare_step_seconds(const Scene& scene, const RobotState& state, const JointCommand& command, int steps) {
  require(steps >= 1, fmt::format("mujoco_bare_step_seconds: steps is {}, expected >= 1", steps));
  MujocoModel compiled = compile_mujoco(scene);
  mjModel& m = *compiled.model;
  mjData& d = *compiled.data;
  write_state(state, compiled, d);
  const int joints = scene.robot->dof();
  for (int i = 0; i < joints; ++i) m.dof_damping[compiled.v_address[i]] = command.kd[i];
  RobotState read = state;
  const double begin = cpu_seconds();
  for (int step = 0; step < steps; ++step) {
    for (int i = 0; i < joints; ++i) {
      const double effort = scene.robot->joints[i].effort;
      const double torque = command.kp[i] * (command.q_target[i] - read.q[i]) + command.tau_ff[i];
      d.qfrc_applied[compiled.v_address[i]] = std::clamp(torque, -effort, effort);
    }
    mj_step(&m, &d);
    read_state(compiled, read);
  }
  return cpu_seconds() - begin;
}

}  // namespace duet
