// The gates of WBC-Sim (training/wbc_gates.h) as figures, its inference and the speed of its training.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "backends/factory.h"
#include "bench/benchmarks/parts.h"
#include "bench/benchmarks/timer.h"
#include "controllers/wbc_sim/wbc_sim.h"
#include "core/share.h"
#include "training/ppo.h"
#include "training/wbc_gates.h"

namespace duet {
namespace {

using Robot = std::shared_ptr<const RobotModel>;

// 32 seeds; with a short measuring time (tests) as few as show that it works.
int trials_of(const BenchmarkOptions& options, int full) { return options.seconds < 0.1 ? 1 : full; }

ControllerMaker maker(const Robot& robot, const std::string& network) {
  const std::string path = share_file("network of WBC-Sim", "controllers/wbc_sim/" + network + ".safetensors");
  const auto loaded = std::make_shared<const WbcNetwork>(load_wbc_network(path, *robot));
  return [robot, loaded] { return make_wbc_sim_controller(robot, loaded); };
}

Figure survival(const std::string& name, const GateResult& result, double least) {
  const double share = static_cast<double>(result.survived) / std::max(1, result.trials);
  Figure figure{name, share, "1",
                fmt::format("at least {:g} of {}", std::ceil(least * result.trials - 1e-9), result.trials),
                share >= least - 1e-9};
  return figure;
}

// Sums over gates, weighted by the trials that survived.
struct Tracking {
  double root = 0.0, angle = 0.0, joints = 0.0, rate = 0.0, hf = 0.0, jerk = 0.0, swing = 0.0, on_time = 0.0,
         closest = 1.0;
  int trials = 0;
  void add(const GateResult& result) {
    const double n = result.survived;
    root += n * result.mean.root_error;
    angle += n * result.mean.root_angle_deg;
    joints += n * result.mean.joint_error;
    rate += n * result.mean.joint_rate_error;
    hf += n * result.mean.hf_ratio;
    jerk += n * result.mean.dof_jerk;
    swing += n * result.mean.swing_height;
    on_time += n * result.mean.on_time;
    if (result.survived > 0) closest = std::min(closest, result.mean.closest_feet);
    trials += result.survived;
  }
  [[nodiscard]] double mean(double sum) const { return trials > 0 ? sum / trials : NAN; }
};

bool starts_with(const WbcGate& gate, const char* prefix) { return gate.name.starts_with(prefix); }

std::vector<Figure> run_gates(const BenchmarkOptions& options, const std::string& network, bool oracle) {
  const Robot robot = load_shared_robot();
  const ControllerMaker make = maker(robot, network);
  const int trials = trials_of(options, 32);
  std::vector<Figure> figures;
  Tracking all, walking;
  for (const WbcGate& gate : wbc_gates()) {
    const GateResult result = run_gate(gate, "mujoco", robot, make, trials, options.threads);
    figures.push_back(
        survival(fmt::format("wbc/{}/{}", network, gate.name), result, oracle ? gate.least_oracle : gate.least));
    all.add(result);
    if (starts_with(gate, "walk/")) walking.add(result);
  }
  const std::string name = "wbc/" + network;
  figures.push_back(at_most(name + "/walk:root_error", walking.mean(walking.root), "m", 0.031));
  figures.push_back(at_most(name + "/walk:root_angle_error", walking.mean(walking.angle), "deg", 13.8));
  figures.push_back(at_least(name + "/walk:swing_height", walking.mean(walking.swing), "m", 0.04));
  figures.push_back({name + "/walk:feet_on_time", walking.mean(walking.on_time), "1", "", true});
  figures.push_back(at_least(name + "/walk:closest_feet", walking.closest, "m", 0.12));
  figures.push_back(at_most(name + ":joint_error", all.mean(all.joints), "rad", 0.10));
  figures.push_back(at_most(name + ":joint_velocity_error", all.mean(all.rate), "rad/s", 0.6));
  figures.push_back(at_most(name + ":hf_ratio", all.mean(all.hf), "1", 0.614));
  figures.push_back(at_most(name + ":dof_jerk", all.mean(all.jerk), "rad/s^3", 2259.0));
  return figures;
}

std::vector<Figure> run_engines(const BenchmarkOptions& options) {
  const Robot robot = load_shared_robot();
  const ControllerMaker make = maker(robot, "student");
  std::vector<Figure> figures;
  for (const EngineInfo& engine : engines()) {
    if (!engine.physics || !engine.available || engine.name == "mujoco") continue;
    GateResult sum;
    for (const WbcGate& gate : wbc_gates()) {
      const GateResult result = run_gate(gate, engine.name, robot, make, trials_of(options, 8), options.threads);
      sum.trials += result.trials;
      sum.survived += result.survived;
    }
    figures.push_back(survival("wbc/engine/" + engine.name, sum, 0.9));
  }
  return figures;
}

std::vector<Figure> time_inference(const BenchmarkOptions& options) {
  const Robot robot = load_shared_robot();
  const std::unique_ptr<Controller> controller = maker(robot, "student")();
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
      make_agent(layout.oracle(), layout.critic(static_cast<int>(critic_links(*robot).size())), robot->dof(), 0.3, 1);
  Ppo ppo(robot, wbc_stage("stand"), options, std::move(state));
  ppo.iterate();
  const double begin = wall_seconds();
  for (int i = 0; i < iterations; ++i) ppo.iterate();
  return iterations * static_cast<double>(options.environments * options.horizon) / (wall_seconds() - begin);
}

std::vector<Figure> time_training(const BenchmarkOptions& options) {
  const Robot robot = load_shared_robot();
  const int iterations = options.seconds < 0.1 ? 1 : 4;
  const double many = training_rate(robot, options.threads, iterations);
  std::vector<Figure> figures = {at_least("wbc/training", many, "steps/s", 6000.0)};
  if (options.threads % 2 == 0)
    figures.push_back(at_least("wbc/training:twice_the_cores",
                               many / training_rate(robot, options.threads / 2, iterations), "1", 1.8));
  return figures;
}

}  // namespace

void add_wbc_benchmarks(std::vector<Benchmark>& list) {
  list.push_back({"wbc/student", "the gates of WBC-Sim, 32 seeds each, in MuJoCo",
                  [](const BenchmarkOptions& options) { return run_gates(options, "student", false); }});
  list.push_back({"wbc/oracle", "the same gates for the oracle it was distilled from",
                  [](const BenchmarkOptions& options) { return run_gates(options, "oracle", true); }});
  list.push_back({"wbc/engine", "survival of the student over all gates in the other engines", run_engines});
  list.push_back({"wbc/inference", "one tick of WBC-Sim: gait, observation, network", time_inference});
  list.push_back({"wbc/training", "the oracle's training, all threads against half of them", time_training});
}

}  // namespace duet
