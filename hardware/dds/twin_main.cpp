// duet-g1-twin: a stand-in for a G1 on the loopback interface, in domains that no robot has. docs/hardware.md, "Twin".
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <chrono>
#include <cmath>
#include <csignal>
#include <cstdio>
#include <thread>

#include "duet/hardware/dds/dds_wire.h"
#include "duet/hardware/guard/guard_loop.h"
#include "duet/hardware/twin/lock_step.h"
#include "duet/hardware/twin/twin_operator.h"
#include "duet/hardware/wire/datagram_socket.h"
#include "duet/hardware/wire/lcm_message.h"

namespace {

using namespace duet;  // a program of its own

constexpr int kWritersEvery = 50, kRemoteEvery = 5;  // ticks
volatile std::sig_atomic_t stopped = 0;

struct TwinArguments {
  DdsPlace place{-1, "lo"};
  TwinOptions options;
  std::vector<std::string> faults;
  double seconds = 0.0;
  std::uint16_t velocity_port = 0;
  bool operated = false, lock_step = false;
};

void take_velocity(DatagramSocket& socket, TwinModel& twin) {
  LcmBuffer buffer;
  while (const std::size_t size = socket.receive(buffer)) {
    PedalCommand pedal;
    if (decode(std::span<const std::byte>(buffer).first(size), pedal).refusal.empty())
      twin.obey(VelocityCommand{pedal.command[0], pedal.command[1], pedal.command[2], pedal.command[3]});
  }
}

struct TwinTotals {
  long states = 0, answered = 0;
  int most_writers = 0;
  double latest = 0.0;  // by which a state left [s]
};

// The twin at its wire: a state every 2 ms, or one for every command.
class WiredTwin {
 public:
  WiredTwin(const TwinArguments& arguments, TwinModel& twin, DatagramSocket& velocity)
      : arguments_(arguments),
        twin_(twin),
        velocity_(velocity),
        wire_(open_twin_wire(arguments.place)),
        faulty_(twin, faults_of(arguments), arguments.options.seed),
        lock_step_(*wire_) {}

  TwinTotals run() {
    auto next = std::chrono::steady_clock::now();
    for (long tick = 1; stopped == 0 && !over(tick); ++tick) {
      if (step(tick) && arguments_.lock_step &&
          lock_step_.await(state_, [&](const auto& frame) { twin_.obey(frame); })) {
        ++totals_.answered;
        next = std::chrono::steady_clock::now();
        continue;
      }
      next += std::chrono::microseconds(2000);
      const double late = std::chrono::duration<double>(std::chrono::steady_clock::now() - next).count();
      totals_.latest = std::max(totals_.latest, late);
      std::this_thread::sleep_until(next);
    }
    return totals_;
  }

 private:
  static std::vector<TwinFault> faults_of(const TwinArguments& arguments) {
    std::vector<TwinFault> faults;
    for (const std::string& text : arguments.faults) faults.push_back(parse_twin_fault(text));
    return faults;
  }
  [[nodiscard]] bool over(long tick) const {
    return arguments_.seconds > 0.0 && static_cast<double>(tick) * kTwinPeriod > arguments_.seconds;
  }
  // Whether a state left.
  bool step(long tick) {
    const double time = static_cast<double>(tick) * kTwinPeriod;
    while (wire_->take(command_)) twin_.obey(command_);
    take_velocity(velocity_, twin_);
    if (arguments_.operated) operator_.tick(time, twin_);
    twin_.step(kTwinPeriod);
    wire_->write(twin_.odometry(time));
    const bool leaves = faulty_.next_state(time, state_);
    if (leaves) wire_->write(state_);
    totals_.states += leaves ? 1 : 0;
    twin_.write_trunk_imu(trunk_imu_);
    wire_->write(trunk_imu_);
    if (tick % kRemoteEvery == 0) wire_->write(twin_.remote);
    if (tick % kWritersEvery == 0) {
      totals_.most_writers = std::max(totals_.most_writers, wire_->command_writers());
      wire_->write(BatteryReading{.charge = twin_.condition.charge});
    }
    return leaves;
  }

  const TwinArguments& arguments_;
  TwinModel& twin_;
  DatagramSocket& velocity_;
  std::unique_ptr<TwinWire> wire_;
  FaultyTwin faulty_;
  LockStepTwin lock_step_;
  TwinOperator operator_;
  TwinTotals totals_;
  LowCommandFrame command_{};
  LowStateFrame state_{};
  ImuFrame trunk_imu_{};
};

void add_options(CLI::App& app, TwinArguments& arguments) {
  TwinOptions& options = arguments.options;
  app.add_option("--domain", arguments.place.domain, "of DDS, 100 to 199, or 1")->required();
  app.add_option("--seconds", arguments.seconds, "for which it runs; 0: until it is stopped");
  app.add_option("--seed", options.seed, "of its noise");
  app.add_option("--physics", options.engine, "engine that simulates its body (mujoco, ...); without: first-order");
  app.add_flag("--lock-step", arguments.lock_step, "each step waits for the command that answers the last state");
  app.add_option("--lag", options.lag, "of the first-order root [s]");
  app.add_option("--delay", options.delay, "of the first-order root's command [s]");
  app.add_option("--drift", options.drift, "of odometry [m/s]");
  app.add_option("--place-noise", options.place_noise, "of odometry [m]");
  app.add_option("--speed-noise", options.speed_noise, "of odometry [m/s]");
  app.add_option("--joint-noise", options.joint_noise, "of measured angles [rad]");
  app.add_option("--joint-speed-noise", options.joint_speed_noise, "of measured speeds of joints [rad/s]");
  app.add_option("--gyro-noise", options.gyro_noise, "of the IMU [rad/s]");
  app.add_option("--acceleration-noise", options.acceleration_noise, "of the IMU [m/s^2]");
  app.add_option("--tilt-noise", options.tilt_noise, "of the IMU's orientation [rad]");
  app.add_option("--mode-machine", options.mode_machine, "that it reports");
  app.add_option("--velocity-port", arguments.velocity_port, "UDP port of 127.0.0.1 for velocities; 0: any");
  app.add_option("--fault", arguments.faults, "KIND@BEGIN:END=VALUE, for example drop@3:5=100")
      ->allow_extra_args(false);
  app.add_flag("--operated", arguments.operated,
               "an operator holds the dead-man switch, stands it up, lets it down and runs it");
}

}  // namespace

int main(int argc, char** argv) {
  TwinArguments arguments;
  CLI::App app(
      "A stand-in for a Unitree G1 on its wire: joints that follow, a root with lag and delay, faults by script; with "
      "--physics a body in an engine, which only the wire's commands hold up.");
  add_options(app, arguments);
  CLI11_PARSE(app, argc, argv);
  std::signal(SIGINT, [](int) { stopped = 1; });
  std::signal(SIGTERM, [](int) { stopped = 1; });
  try {
    TwinModel twin(load_shared_robot(), arguments.options);
    DatagramSocket velocity = DatagramSocket::at_port(arguments.velocity_port);
    if (arguments.lock_step)
      ask_for_sharp_timers();
    else
      (void)ask_for_real_time();
    WiredTwin wired(arguments, twin, velocity);
    fmt::print("twin: domain {} on {}, velocity at port {}, seed {}, {}, {}\n", arguments.place.domain,
               arguments.place.interface, velocity.port(), arguments.options.seed,
               twin.physics() != nullptr ? arguments.options.engine : "first-order",
               arguments.lock_step ? "in lock-step" : "500 Hz");
    std::fflush(stdout);
    const TwinTotals totals = wired.run();
    fmt::print(
        "twin: {} states sent ({} answered in lock-step, the latest {:.1f} ms late), {} commands obeyed, {} refused, "
        "{} "
        "writers of commands seen at most\n",
        totals.states, totals.answered, 1e3 * totals.latest, twin.obeyed_frames(), twin.refused_frames(),
        totals.most_writers);
    return 0;
  } catch (const std::exception& error) {
    fmt::print(stderr, "duet-g1-twin: {}\n", error.what());
    return 2;
  }
}
