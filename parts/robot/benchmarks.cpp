// Benchmarks of the robot's side: guard and limiter, and the wire.
#include <fmt/format.h>
#include <signal.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <filesystem>
#include <functional>
#include <future>
#include <span>
#include <stdexcept>
#include <thread>
#include <vector>

#include "duet/app/benchmarks/benchmark.h"
#include "duet/core/require.h"
#include "duet/hardware/dds/dds_wire.h"
#include "duet/hardware/guard/guard_loop.h"
#include "duet/hardware/guard/robot_connection.h"
#include "duet/hardware/twin/odometry_trial.h"
#include "duet/hardware/twin/twin_model.h"
#include "duet/hardware/wire/datagram_socket.h"
#include "duet/hardware/wire/low_level_frame.h"
#include "duet/parts/robot/part.h"

namespace duet {

// A tick of the guard, with a twin behind a wire in memory: limiter, state machine, frame, checksum. Figures of this
// machine; no test asserts them.

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
  if (tick > 1800 && tick < 1850) twin.remote.keys |= key(RemoteKey::kA);
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

extern char** environ;

namespace duet {

// The round trip of a command over DDS between two processes on the loopback interface, 500 times a second: written
// here, answered by `duet-g1-services --echo` with a state that carries its number. Beside it the round trip of as many
// bytes over plain UDP between two threads: what of it is the machine's. Figures of this machine; no test asserts them.

namespace {

constexpr double kRoundPeriod = 0.002;  // [s]
constexpr int kRoundDomain = 198;
constexpr double kFirstAnswer = 10.0;  // for which the other process is waited for [s]
constexpr double kLost = 0.2;          // an answer that has not come by then [s]

class EchoProcess {
 public:
  EchoProcess() {
    const std::filesystem::path program =
        std::filesystem::read_symlink("/proc/self/exe").parent_path() / "duet-g1-services";
    if (!std::filesystem::exists(program))
      throw MissingError("hardware/wire needs duet-g1-services beside the program, and it is not there");
    std::string arguments[] = {program.string(), "--echo", "--domain", std::to_string(kRoundDomain)};
    char* raw[] = {arguments[0].data(), arguments[1].data(), arguments[2].data(), arguments[3].data(), nullptr};
    if (posix_spawn(&pid_, raw[0], nullptr, nullptr, raw, environ) != 0)
      throw std::runtime_error("hardware/wire: duet-g1-services cannot be started");
  }
  ~EchoProcess() {
    kill(pid_, SIGTERM);
    waitpid(pid_, nullptr, 0);
  }
  EchoProcess(const EchoProcess&) = delete;
  EchoProcess& operator=(const EchoProcess&) = delete;

 private:
  pid_t pid_ = -1;
};

struct RoundTrips {
  std::vector<double> seconds;  // sorted
  bool real_time = false;       // the priority that the guard asks for was given
  long sent = 0, lost = 0, bad = 0;
};

LowCommandFrame numbered(std::uint32_t number) {
  LowCommandFrame frame;
  build_damping(kDampingGain, 5, frame);
  frame.reserve[0] = number;
  frame.crc = checksum_of(frame);
  return frame;
}

// The seconds until the answer to `number`; below 0 where none came.
double round_trip(RobotWire& wire, std::uint32_t number, RoundTrips& trips) {
  const LowCommandFrame frame = numbered(number);
  const double begin = monotonic_seconds();
  (void)wire.write(frame);
  LowStateFrame state;
  while (monotonic_seconds() - begin < kLost) {
    (void)wire.wait(kLost);
    while (wire.take(state)) {
      if (state.crc != checksum_of(state)) ++trips.bad;
      if (state.tick == number) return monotonic_seconds() - begin;
    }
  }
  return -1.0;
}

// Round trips at 500 Hz for so many seconds. `trip`: one with that number, as round_trip(); `number`: the last one
// used.
void time_trips(double seconds, std::uint32_t number, const std::function<double(std::uint32_t)>& trip,
                RoundTrips& trips) {
  double next = monotonic_seconds();
  for (const long count = std::max(100L, static_cast<long>(seconds / kRoundPeriod)); trips.sent < count; ++trips.sent) {
    next = std::max(next + kRoundPeriod, monotonic_seconds());
    usleep(static_cast<useconds_t>(1e6 * std::max(0.0, next - monotonic_seconds())));
    const double taken = trip(++number);
    if (taken < 0.0)
      ++trips.lost;
    else
      trips.seconds.push_back(taken);
  }
  std::ranges::sort(trips.seconds);
}

// Measures round trips over DDS.
RoundTrips measure(double seconds) {
  const bool real_time = ask_for_real_time();
  const EchoProcess echo;
  const std::unique_ptr<RobotWire> wire = open_robot_wire({kRoundDomain, "lo"});
  wire->open_writer();
  RoundTrips trips, found;
  trips.real_time = real_time;
  std::uint32_t number = 0;
  const double begin = monotonic_seconds();
  while (round_trip(*wire, ++number, found) < 0.0)
    if (monotonic_seconds() - begin > kFirstAnswer)
      throw std::runtime_error("hardware/wire: no answer has come from duet-g1-services");
  time_trips(
      seconds, number, [&](std::uint32_t next) { return round_trip(*wire, next, trips); }, trips);
  return trips;
}

// Measures round trips over plain UDP, a command one way and a state the other.
RoundTrips measure_udp(double seconds) {
  ask_for_real_time();
  DatagramSocket commands = DatagramSocket::at_port(0), states = DatagramSocket::at_port(0);
  const std::jthread echo([&commands, port = states.port()](const std::stop_token& stop) {
    ask_for_real_time();
    DatagramSocket answers = DatagramSocket::to_port(port);
    LowCommandFrame command;
    LowStateFrame state{};
    while (!stop.stop_requested()) {
      if (!commands.wait(kLost) || commands.receive(std::as_writable_bytes(std::span(&command, 1))) == 0) continue;
      state.tick = command.reserve[0];
      seal(state);
      answers.send(std::as_bytes(std::span(&state, 1)));
    }
  });
  DatagramSocket asks = DatagramSocket::to_port(commands.port());
  const auto trip = [&](std::uint32_t number) {
    const LowCommandFrame frame = numbered(number);
    const double begin = monotonic_seconds();
    asks.send(std::as_bytes(std::span(&frame, 1)));
    LowStateFrame state{};
    while (states.wait(kLost)) {
      states.receive(std::as_writable_bytes(std::span(&state, 1)));
      if (state.crc == checksum_of(state) && state.tick == number) return monotonic_seconds() - begin;
    }
    return -1.0;
  };
  RoundTrips trips;
  time_trips(seconds, 0, trip, trips);
  return trips;
}

// [us] that so large a share of the trips does not take.
double share_us(const RoundTrips& trips, double share) {
  if (trips.seconds.empty()) throw std::runtime_error("hardware/wire: every answer was lost");
  return 1e6 * trips.seconds[static_cast<std::size_t>(share * static_cast<double>(trips.seconds.size() - 1))];
}

std::vector<BenchmarkFigure> time_round_trips(const BenchmarkOptions& options) {
  constexpr double kLonger = 30.0;  // than other figures: tails are rare
  // On a thread of its own: its priority ends with it.
  const RoundTrips trips = std::async(std::launch::async, measure, kLonger * options.seconds).get();
  const RoundTrips udp = std::async(std::launch::async, measure_udp, 5.0 * options.seconds).get();
  const std::string name = "hardware/wire";
  return {{name + ":real_time_priority", trips.real_time ? 1.0 : 0.0, "1", "", true},
          {name + ":sent", static_cast<double>(trips.sent), "1", "", true},
          at_most(name + ":lost", static_cast<double>(trips.lost), "1", 0.0),
          at_most(name + ":bad_checksums", static_cast<double>(trips.bad), "1", 0.0),
          at_most(name + ":p50", share_us(trips, 0.5), "us", 60.0),
          at_most(name + ":p99", share_us(trips, 0.99), "us", 500.0),
          {name + ":largest", 1e6 * trips.seconds.back(), "us", "", true},
          {name + "/plain_udp:p50", share_us(udp, 0.5), "us", "", true},
          {name + "/plain_udp:p99", share_us(udp, 0.99), "us", "", true},
          {name + ":over_plain_udp", share_us(trips, 0.5) / share_us(udp, 0.5), "1", "", true}};
}

// Forward, sideways and on a curve; clean and with the noise of usual encoders and a usual IMU.
std::vector<BenchmarkFigure> measure_odometry(const BenchmarkOptions&) {
  struct Walk {
    const char* name;
    Eigen::Vector3d velocity;
  };
  std::vector<BenchmarkFigure> figures;
  for (const bool noisy : {false, true})
    for (const Walk& walk :
         {Walk{"forward", {0.3, 0.0, 0.0}}, Walk{"sideways", {0.0, 0.15, 0.0}}, Walk{"curve", {0.25, 0.0, 0.3}}}) {
      OdometryTrial trial;
      trial.velocity = walk.velocity;
      if (noisy) {
        trial.joint_noise = 0.001;
        trial.joint_speed_noise = 0.05;
        trial.gyro_noise = 0.02;
        trial.tilt_noise = 0.003;
        trial.force_noise = 0.3;
        trial.force_bias = 0.05;
      }
      const OdometryError error = measure_leg_odometry(load_shared_robot(), trial);
      const std::string name = fmt::format("hardware/odometry/{}{}", walk.name, noisy ? "/noisy" : "");
      figures.push_back({name + ":walked", error.walked, "m", "", true});
      figures.push_back({name + ":end", error.end, "m", "", true});
      figures.push_back({name + ":largest", error.largest, "m", "", true});
      figures.push_back({name + ":speed_rms", error.speed_rms, "m/s", "", !error.fell});
    }
  return figures;
}

}  // namespace

void add_wire_benchmark(std::vector<Benchmark>& list) {
  if (has_dds())
    list.push_back(
        {"hardware/wire", "round trip of a command over DDS at 500 Hz, two processes on loopback", time_round_trips});
  list.push_back({"hardware/odometry", "error of leg odometry: 12 s in MuJoCo under WBC-Sim", measure_odometry});
}

}  // namespace duet
