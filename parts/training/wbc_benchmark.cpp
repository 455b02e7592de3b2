// The inference of WBC-Sim and the speed of its training; how it stands and walks is suites/wbc_gates.yaml.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "duet/app/benchmarks/benchmark.h"
#include "duet/controllers/catalogue/registry.h"
#include "duet/controllers/controller.h"
#include "duet/controllers/wbc_sim/observation.h"
#include "duet/nn/dense_kernels.h"
#include "duet/parts/training/part.h"
#include "duet/training/ppo.h"

namespace duet {
namespace {

using Robot = std::shared_ptr<const RobotModel>;

std::vector<BenchmarkFigure> time_wbc_inference(const BenchmarkOptions& options) {
  const Robot robot = load_shared_robot();
  const std::unique_ptr<Controller> controller = make_controller("wbc_sim", robot);
  const RobotState state = robot->standing_state();
  const Reference reference{state.X_WB, state.q};
  JointCommand command;
  controller->reset(state);
  controller->act(state, reference, command);
  const double seconds = best_call_seconds([&] { controller->act(state, reference, command); }, options.seconds);
  return {at_most("wbc/inference", 1e6 * seconds, "us", 30.0)};
}

// Environment steps per second of the oracle's training: rollout and learning.
double training_rate(const Robot& robot, int threads, int iterations) {
  PpoOptions options;
  options.threads = threads;
  TrainingState state;
  const WbcLayout layout(robot->dof());
  state.agent =
      make_agent(layout.oracle(), layout.critic(static_cast<int>(robot->roles.bodies.size())), robot->dof(), 0.3, 1);
  Ppo ppo(robot, wbc_stage("stand"), options, std::move(state));
  ppo.iterate();
  const double begin = wall_seconds();
  for (int i = 0; i < iterations; ++i) ppo.iterate();
  return iterations * static_cast<double>(options.environments * options.horizon) / (wall_seconds() - begin);
}

std::vector<BenchmarkFigure> time_training(const BenchmarkOptions& options) {
  const Robot robot = load_shared_robot();
  const int iterations = options.seconds < 0.1 ? 1 : 4;
  const double many = training_rate(robot, options.threads, iterations);
  const bool wide = dense_kernels().level == InstructionSet::kV4;
  std::vector<BenchmarkFigure> figures = {at_least("wbc/training", many, "steps/s", wide ? 10000.0 : 8000.0)};
  if (options.threads % 2 == 0)
    figures.push_back(at_least("wbc/training:twice_the_cores",
                               many / training_rate(robot, options.threads / 2, iterations), "1", 1.8));
  return figures;
}

}  // namespace

void add_wbc_benchmarks(std::vector<Benchmark>& list) {
  list.push_back({"wbc/inference", "one tick of WBC-Sim: gait, observation, network", time_wbc_inference});
  list.push_back({"wbc/training", "the oracle's training, all threads against half of them", time_training});
}

}  // namespace duet
