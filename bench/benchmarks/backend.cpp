#include <algorithm>
#include <memory>

#include "backends/factory.h"
#include "bench/benchmarks/parts.h"
#include "bench/benchmarks/timer.h"
#include "robots/robot_model.h"

namespace duet {
namespace {

constexpr int kSteps = 500;  // 1 s at 2 ms: the robot still stands on its feet

Scene standing_scene() {
  Scene scene;
  scene.robot = load_shared_robot();
  scene.partner = PartnerMode::kNone;
  return scene;
}

// CPU seconds of one step of our backend, standing on its feet under PD, the state read back.
double backend_step_seconds(Backend& backend, const RobotState& start, const JointCommand& command) {
  backend.reset(start);
  const double begin = cpu_seconds();
  for (int i = 0; i < kSteps; ++i) backend.step(command);
  return (cpu_seconds() - begin) / kSteps;
}

struct StepTimes {
  double ours = 1e9, bare = 1e9;  // best of interleaved rounds [s]
};

StepTimes time_steps(const BenchmarkOptions& options) {
  const Scene scene = standing_scene();
  const std::unique_ptr<Backend> backend = make_backend("mujoco", scene);
  const RobotState start = scene.robot->standing_state();
  const JointCommand command = scene.robot->default_command(start.q);
  StepTimes times;
  const double begin = wall_seconds();
  do {
    times.ours = std::min(times.ours, backend_step_seconds(*backend, start, command));
    times.bare =
        std::min(times.bare, engine_module("mujoco").bare_step_seconds(scene, start, command, kSteps) / kSteps);
  } while (wall_seconds() - begin < 3.0 * options.seconds);
  return times;
}

std::vector<Figure> time_step(const BenchmarkOptions& options) {
  const StepTimes times = time_steps(options);
  return {at_most("backend/mujoco/step", 1e6 * times.ours, "us", 25.0),
          at_least("backend/mujoco/step:real_time_factor", 0.002 / times.ours, "1", 80.0)};
}

std::vector<Figure> time_overhead(const BenchmarkOptions& options) {
  const StepTimes times = time_steps(options);
  return {at_most("backend/mujoco/overhead", 100.0 * (times.ours / times.bare - 1.0), "%", 5.0),
          {"backend/mujoco/overhead:bare_step", 1e6 * times.bare, "us", "", true}};
}

}  // namespace

void add_backend_benchmarks(std::vector<Benchmark>& list) {
  list.push_back({"backend/mujoco/step", "one step of 2 ms, G1 on its feet under PD, state read back", time_step});
  list.push_back({"backend/mujoco/overhead", "the same over a bare mj_step loop with the same model", time_overhead});
}

}  // namespace duet
