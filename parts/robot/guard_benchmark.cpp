// A tick of the guard, with a twin behind a wire in memory: limiter, state machine, frame, checksum. Figures of this
// machine; no test asserts them.
#include <algorithm>
#include <stdexcept>

#include "duet/app/benchmarks/parts.h"
#include "duet/app/benchmarks/timer.h"
#include "duet/hardware/frame_checksum.h"
#include "duet/hardware/guard_loop.h"
#include "duet/hardware/robot_config.h"
#include "duet/hardware/twin_model.h"
#include "duet/parts/robot/part.h"

namespace duet {
namespace {

constexpr double kGuardPeriod = 0.002;  // [s]

// The twin on the other side of nothing but a copy.
class NearTwin final : public FrameTransport {
 public:
  explicit NearTwin(TwinModel& twin) : twin_(twin) {}
  void step() {
    twin_.step(kGuardPeriod);
    twin_.write_state(state_);
    waits_ = true;
  }
  bool take(LowStateFrame& frame) override {
    if (!waits_) return false;
    frame = state_;
    waits_ = false;
    return true;
  }
  int foreign_writers() override { return 0; }
  void open_writer() override { writer_ = true; }
  void close_writer() override { writer_ = false; }
  [[nodiscard]] bool has_writer() const override { return writer_; }
  bool write(const LowCommandFrame& frame) override {
    twin_.obey(frame);
    return true;
  }

 private:
  TwinModel& twin_;
  LowStateFrame state_{};
  bool waits_ = false, writer_ = false;
};

RobotConfig benchmark_config(bool person) {
  RobotConfig config;
  config.permission = {.allow_motion = true, .robot = "twin", .interface = "lo", .domain = 150, .mode_machine = 5};
  config.twin = true;
  config.person = person;
  return config;
}

// Somebody 4 m away: every pair of capsules is measured.
HumanJoints far_person() {
  HumanJoints joints;
  for (int j = 0; j < 24; ++j) joints.col(j) = Eigen::Vector3d(4.0, 0.02 * (j % 3), 0.1 + 0.06 * j);
  return joints;
}

constexpr int kRunsFrom = 2000;  // ticks: armed, stood up, running

// Does what an operator does until then.
void operate(int tick, TwinModel& twin, RobotGuard& guard) {
  const auto key = [](RemoteKey k) { return static_cast<std::uint16_t>(1u << static_cast<int>(k)); };
  twin.remote.keys = key(RemoteKey::kR1);
  if (tick == 1200) guard.arm();
  if (tick > 1250 && tick < 1300) twin.remote.keys |= key(RemoteKey::kStart);
  if (tick > 1700 && tick < 1750) twin.remote.keys |= key(RemoteKey::kA);
}

// Seconds of each of `count` ticks of a running guard, sorted. Throws std::runtime_error where it does not run.
std::vector<double> tick_seconds(bool person, int count) {
  TwinModel twin(load_shared_robot(), {});
  NearTwin wire(twin);
  NoVelocity nobody;
  RobotGuard guard(guard_setup(benchmark_config(person), false), wire, nobody);
  PlannerMessage planned;
  planned.command.q = load_shared_robot()->neutral;
  planned.command.root = {0.1, 0.0, 0.0, 0.74};
  PersonMessage seen{.sequence = 0, .joints = far_person()};
  std::vector<double> seconds;
  double now = 100.0;
  for (int k = 0; k < kRunsFrom + count; ++k) {
    now += kGuardPeriod;
    operate(k, twin, guard);
    wire.step();
    planned.command.stamp = now;
    ++planned.sequence;
    ++seen.sequence;
    guard.receive(planned, now);
    guard.receive(seen, now);
    guard.receive(twin.odometry(now));
    guard.receive(BatteryReading{.charge = twin.condition.charge}, now);
    const double begin = wall_seconds();
    guard.tick(now);
    if (k >= kRunsFrom) seconds.push_back(wall_seconds() - begin);
  }
  if (guard.status().safety.state != SafetyState::kRun) throw std::runtime_error("benchmark: the guard does not run");
  std::ranges::sort(seconds);
  return seconds;
}

std::vector<BenchmarkFigure> time_tick(bool person, const BenchmarkOptions& options) {
  const int count = std::max(500, static_cast<int>(options.seconds * 10000.0));
  const std::vector<double> seconds = tick_seconds(person, count);
  const std::string name = person ? "hardware/tick/person" : "hardware/tick/alone";
  const auto share = [&](double s) { return 1e6 * seconds[static_cast<std::size_t>(s * (count - 1))]; };
  return {{name + ":p50", share(0.5), "us", "", true},
          at_most(name + ":p99", share(0.99), "us", 100.0),
          {name + ":largest", 1e6 * seconds.back(), "us", "", true}};
}

std::vector<BenchmarkFigure> time_checksum(const BenchmarkOptions& options) {
  LowCommandFrame frame;
  build_damping(kDampingGain, 5, frame);
  volatile std::uint32_t kept = 0;
  const double seconds = best_call_seconds([&] { kept = checksum_of(frame); }, options.seconds);
  return {{"hardware/checksum", 1e6 * seconds, "us", "", true}};
}

}  // namespace

void add_hardware_benchmarks(std::vector<Benchmark>& list) {
  list.push_back({"hardware/tick/alone", "a tick of the guard with nobody near",
                  [](const BenchmarkOptions& options) { return time_tick(false, options); }});
  list.push_back({"hardware/tick/person", "the same beside a person",
                  [](const BenchmarkOptions& options) { return time_tick(true, options); }});
  list.push_back({"hardware/checksum", "of a low-level command", time_checksum});
}

}  // namespace duet
