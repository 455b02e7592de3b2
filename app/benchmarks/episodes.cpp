// Benchmarks of episodes: engines and whole runs.
#include <malloc.h>

#include <algorithm>
#include <atomic>
#include <latch>
#include <memory>
#include <thread>

#include "duet/app/benchmarks/benchmark.h"
#include "duet/backends/engine_module.h"
#include "duet/core/file_batch.h"
#include "duet/execution/runner.h"
#include "duet/experiment/suite/profile.h"
#include "duet/experiment/suite/suite.h"
#include "duet/robots/robot_model.h"

namespace duet {
namespace {

constexpr int kSteps = 500;             // 1 s at 2 ms: the robot still stands on its feet
constexpr double kOverheadLimit = 5.0;  // [%]

Scene standing_scene(const std::string& engine) {
  const EngineSettings settings = load_profile("parity").settings(engine);
  Scene scene;
  scene.robot = load_shared_robot();
  scene.partner = PartnerMode::kNone;
  scene.dt = settings.dt;
  scene.options = settings.options;
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

StepTimes time_steps(const std::string& engine, const BenchmarkOptions& options) {
  const Scene scene = standing_scene(engine);
  const std::unique_ptr<Backend> backend = make_backend(engine, scene);
  const EngineModule& module = engine_module(engine);
  const RobotState start = scene.robot->standing_state();
  const JointCommand command = scene.robot->default_command(start.q);
  StepTimes times;
  const double begin = wall_seconds();
  do {
    times.ours = std::min(times.ours, backend_step_seconds(*backend, start, command));
    times.bare = std::min(times.bare, module.bare_step_seconds(scene, start, command, kSteps) / kSteps);
  } while (wall_seconds() - begin < 3.0 * options.seconds);
  return times;
}

std::vector<BenchmarkFigure> time_step(const std::string& engine, const BenchmarkOptions& options) {
  const StepTimes times = time_steps(engine, options);
  const std::string name = "backend/" + engine + "/step";
  const double dt = standing_scene(engine).dt, target = engine_module(engine).step_target_us;
  return {target > 0.0 ? at_most(name, 1e6 * times.ours, "us", target)
                       : BenchmarkFigure{name, 1e6 * times.ours, "us", "", true},
          at_least(name + ":real_time_factor", dt / times.ours, "1", 20.0)};
}

std::vector<BenchmarkFigure> time_overhead(const std::string& engine, const BenchmarkOptions& options) {
  const StepTimes times = time_steps(engine, options);
  const std::string name = "backend/" + engine + "/overhead";
  return {at_most(name, 100.0 * (times.ours / times.bare - 1.0), "%", kOverheadLimit),
          {name + ":bare_step", 1e6 * times.bare, "us", "", true}};
}

// Wall time in which episodes of a second of standing are worked off by the threads, a world each. [s]
double stand_seconds(const std::string& engine, int episodes, int threads) {
  const Scene scene = standing_scene(engine);
  const RobotState start = scene.robot->standing_state();
  const JointCommand command = scene.robot->default_command(start.q);
  std::latch built(threads + 1);
  std::atomic<int> next = 0;
  const auto work = [&] {
    const std::unique_ptr<Backend> backend = make_backend(engine, scene);
    built.arrive_and_wait();
    while (next++ < episodes) backend_step_seconds(*backend, start, command);
  };
  std::vector<std::thread> pool;
  pool.reserve(threads);
  for (int i = 0; i < threads; ++i) pool.emplace_back(work);
  built.arrive_and_wait();
  const double begin = wall_seconds();
  for (std::thread& thread : pool) thread.join();
  return wall_seconds() - begin;
}

std::vector<BenchmarkFigure> time_scaling(const std::string& engine, const BenchmarkOptions& options) {
  constexpr int kEpisodes = 16;
  double one = 1e9, many = 1e9;
  const double begin = wall_seconds();
  do {
    one = std::min(one, stand_seconds(engine, kEpisodes, 1));
    many = std::min(many, stand_seconds(engine, kEpisodes, options.threads));
  } while (wall_seconds() - begin < 3.0 * options.seconds);
  const std::string name = "backend/" + engine + "/scaling";
  // The target is for two cores; with another number the figure is printed as it is.
  return {
      options.threads == 2 ? at_least(name, one / many, "1", 1.9) : BenchmarkFigure{name, one / many, "1", "", true},
      {name + ":threads", static_cast<double>(options.threads), "1", "", true}};
}

// The memory in this thread's allocations: the heap's used blocks and the large ones beside it.
double allocated_kib() {
  const struct mallinfo2 info = mallinfo2();
  return static_cast<double>(info.uordblks + info.hblkhd) / 1024.0;
}

// Memory is that of worlds beyond the first, which also pays for what all share.
std::vector<BenchmarkFigure> time_world(const std::string& engine, const BenchmarkOptions&) {
  constexpr int kWorlds = 16;
  const Scene scene = standing_scene(engine);
  const RobotState start = scene.robot->standing_state();
  const JointCommand command = scene.robot->default_command(start.q);
  std::vector<std::unique_ptr<Backend>> worlds;
  double build = 1e9, before = 0.0;
  for (int i = 0; i <= kWorlds; ++i) {
    const double begin = cpu_seconds();
    worlds.push_back(make_backend(engine, scene));
    build = std::min(build, cpu_seconds() - begin);
    worlds.back()->reset(start);
    for (int step = 0; step < 5; ++step) worlds.back()->step(command);
    if (i == 0) before = allocated_kib();
  }
  const double memory = (allocated_kib() - before) / kWorlds;
  const double reset = best_call_seconds([&] { worlds.front()->reset(start); }, 0.1);
  const std::string name = "backend/" + engine + "/world";
  return {at_most(name + ":memory", memory, "KiB", 1024.0), at_most(name + ":build", 1e3 * build, "ms", 10.0),
          at_most(name + ":reset", 1e6 * reset, "us", 200.0)};
}

}  // namespace

void add_backend_benchmarks(std::vector<Benchmark>& list) {
  for (const EngineInfo& info : engines()) {
    if (!info.available || engine_module(info.name).bare_step_seconds == nullptr) continue;
    const std::string engine = info.name, name = "backend/" + engine;
    list.push_back({name + "/step", "one step of the parity profile, G1 on its feet under PD, state read back",
                    [engine](const BenchmarkOptions& options) { return time_step(engine, options); }});
    list.push_back({name + "/overhead", "the same over a bare loop of the same engine calls",
                    [engine](const BenchmarkOptions& options) { return time_overhead(engine, options); }});
    list.push_back({name + "/scaling", "episodes per second on all threads against one",
                    [engine](const BenchmarkOptions& options) { return time_scaling(engine, options); }});
    list.push_back({name + "/world", "memory, building and resetting of a world",
                    [engine](const BenchmarkOptions& options) { return time_world(engine, options); }});
  }
}

namespace {

constexpr double kEpisodes = 48.0;  // 2 tasks x 12 clips x 2 arms
constexpr const char* kSuite = R"(
schema: duet.suite/1
name: bench-runner
version: 1.0.0
clips: {synth: {per_task: 12, seed: 42}}
tasks: [wave, high_five]
engines: [mujoco]
controllers: [vmc]
policies: [replay]
)";

// Wall time of the suite with a number of threads, in a folder that is removed again. [s]
double run_seconds(const Suite& suite, int threads) {
  const ScratchFolder folder;
  RunOptions options;
  options.threads = threads;
  Progress quiet(Progress::Style::kQuiet);
  const double begin = wall_seconds();
  run_suite(suite, folder / "run", options, quiet);
  return wall_seconds() - begin;
}

std::vector<BenchmarkFigure> time_suite_scaling(const BenchmarkOptions& options) {
  constexpr int kRounds = 2;
  const Suite suite = parse_suite(kSuite, "bench-runner");
  double one = 1e9, many = 1e9;
  for (int round = 0; round < kRounds; ++round) {
    one = std::min(one, run_seconds(suite, 1));
    many = std::min(many, run_seconds(suite, options.threads));
  }
  std::vector<BenchmarkFigure> figures;
  const std::string name = "runner/scaling";
  // The target is for two cores; with another number the figure is printed as it is.
  figures.push_back(options.threads == 2 ? at_least(name, one / many, "1", 1.9)
                                         : BenchmarkFigure{name, one / many, "1", "", true});
  figures.push_back({name + ":threads", static_cast<double>(options.threads), "1", "", true});
  figures.push_back({name + ":episodes_per_second", kEpisodes / many, "1/s", "", true});
  figures.push_back(at_most(name + ":peak_memory", peak_memory_mib(), "MiB", 1024.0));
  return figures;
}

}  // namespace

void add_runner_benchmarks(std::vector<Benchmark>& list) {
  list.push_back({"runner/scaling", "a suite of 48 episodes on all threads against one", time_suite_scaling});
}

}  // namespace duet
