// duet-g1-twin: a stand-in for a G1 on the loopback interface, in domains that no robot has. docs/hardware.md, "Twin".
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <atomic>
#include <cmath>
#include <csignal>
#include <cstdio>
#include <thread>

#include "duet/hardware/datagram_socket.h"
#include "duet/hardware/dds/dds_wire.h"
#include "duet/hardware/lcm_message.h"
#include "duet/hardware/twin_fault.h"

namespace {

using namespace duet;  // a program of its own

constexpr double kPeriod = 0.002;   // of states [s]
constexpr int kWritersEvery = 50;   // ticks
constexpr double kDampedFor = 0.5;  // until the scripted operator stands it up [s]
constexpr double kStoodFor = 2.0;   // until it is told to run [s]
constexpr double kPressed = 0.1;    // [s]
volatile std::sig_atomic_t stopped = 0;

struct TwinArguments {
  DdsPlace place{-1, "lo"};
  TwinOptions options;
  std::vector<std::string> faults;
  double seconds = 0.0;
  std::uint16_t velocity_port = 0;
  bool operated = false, presses = false;
};

// The operator of a demonstration: holds the dead-man switch, stands the robot up once it is damped, then runs it.
class ScriptedOperator {
 public:
  void tick(double time, TwinModel& twin) {
    std::uint16_t keys = bit(RemoteKey::kR1);
    const MotorCommandFrame& motor = twin.last_command().motor[0];
    const bool damped = motor.mode == 1 && motor.kp == 0.0f, held = motor.mode == 1 && motor.kp > 0.0f;
    if (!damped) damped_since_ = time;
    if (!held) held_since_ = time;
    if (!stood_ && time - damped_since_ > kDampedFor) press(RemoteKey::kStart, time, stood_);
    if (stood_ && !ran_ && time - held_since_ > kStoodFor) press(RemoteKey::kA, time, ran_);
    if (time < until_) keys |= bit(pressed_);
    twin.remote.keys = keys;
  }

 private:
  static std::uint16_t bit(RemoteKey key) { return static_cast<std::uint16_t>(1u << static_cast<int>(key)); }
  void press(RemoteKey key, double time, bool& done) {
    pressed_ = key;
    until_ = time + kPressed;
    done = true;
  }

  double damped_since_ = 0.0, held_since_ = 0.0, until_ = 0.0;
  RemoteKey pressed_ = RemoteKey::kStart;
  bool stood_ = false, ran_ = false;
};

// The same by the clock alone, for programs that command the motors before anybody has armed: R1 held, start and A in
// turn.
void press_in_turn(double time, TwinModel& twin) {
  const auto bit = [](RemoteKey key) { return static_cast<std::uint16_t>(1u << static_cast<int>(key)); };
  const double second = std::floor(time);
  const bool pressed = time - second < kPressed;
  const RemoteKey key = static_cast<long>(second) % 2 == 0 ? RemoteKey::kStart : RemoteKey::kA;
  twin.remote.keys = static_cast<std::uint16_t>(bit(RemoteKey::kR1) | (pressed ? bit(key) : 0));
}

void take_velocity(DatagramSocket& socket, TwinModel& twin) {
  LcmBuffer buffer;
  while (const std::size_t size = socket.receive(buffer)) {
    PedalCommand pedal;
    if (decode(std::span<const std::byte>(buffer).first(size), pedal).refusal.empty())
      twin.obey(VelocityCommand{pedal.command[0], pedal.command[1], pedal.command[2], pedal.command[3]});
  }
}

struct TwinTotals {
  long states = 0;
  int most_writers = 0;
};

TwinTotals run(const TwinArguments& arguments, TwinModel& twin, DatagramSocket& velocity) {
  const std::unique_ptr<TwinWire> wire = open_twin_wire(arguments.place);
  std::vector<TwinFault> faults;
  for (const std::string& text : arguments.faults) faults.push_back(parse_twin_fault(text));
  FaultyTwin faulty(twin, faults, arguments.options.seed);
  ScriptedOperator scripted;
  TwinTotals totals;
  fmt::print("twin: domain {} on {}, velocity at port {}, seed {}\n", arguments.place.domain, arguments.place.interface,
             velocity.port(), arguments.options.seed);
  std::fflush(stdout);
  auto next = std::chrono::steady_clock::now();
  LowCommandFrame command;
  LowStateFrame state;
  for (long tick = 1; stopped == 0 && (arguments.seconds <= 0.0 || tick * kPeriod <= arguments.seconds); ++tick) {
    const double time = static_cast<double>(tick) * kPeriod;
    while (wire->take(command)) twin.obey(command);
    take_velocity(velocity, twin);
    if (arguments.operated) scripted.tick(time, twin);
    if (arguments.presses) press_in_turn(time, twin);
    twin.step(kPeriod);
    if (faulty.next_state(time, state)) {
      wire->write(state);
      ++totals.states;
    }
    wire->write(twin.odometry(time));
    if (tick % kWritersEvery == 0) {
      totals.most_writers = std::max(totals.most_writers, wire->command_writers());
      wire->write(BatteryReading{.charge = twin.condition.charge});
    }
    next += std::chrono::microseconds(2000);
    std::this_thread::sleep_until(next);
  }
  return totals;
}

}  // namespace

int main(int argc, char** argv) {
  TwinArguments arguments;
  CLI::App app(
      "A stand-in for a Unitree G1 on its wire: joints that follow, a root with lag and delay, faults by script. It "
      "has no gait.");
  app.add_option("--domain", arguments.place.domain, "of DDS, 100 to 199")->required();
  app.add_option("--seconds", arguments.seconds, "for which it runs; 0: until it is stopped");
  app.add_option("--seed", arguments.options.seed, "of its noise");
  app.add_option("--lag", arguments.options.lag, "of the root [s]");
  app.add_option("--delay", arguments.options.delay, "of the root's command [s]");
  app.add_option("--drift", arguments.options.drift, "of odometry [m/s]");
  app.add_option("--place-noise", arguments.options.place_noise, "of odometry [m]");
  app.add_option("--velocity-port", arguments.velocity_port, "UDP port of 127.0.0.1 for velocities; 0: any");
  app.add_option("--fault", arguments.faults, "KIND@BEGIN:END=VALUE, for example drop@3:5=100")
      ->allow_extra_args(false);
  app.add_flag("--operated", arguments.operated, "an operator holds the dead-man switch, stands it up and runs it");
  app.add_flag("--presses", arguments.presses, "an operator holds the dead-man switch and presses start and A in turn");
  CLI11_PARSE(app, argc, argv);
  std::signal(SIGINT, [](int) { stopped = 1; });
  std::signal(SIGTERM, [](int) { stopped = 1; });
  try {
    TwinModel twin(load_shared_robot(), arguments.options);
    DatagramSocket velocity = DatagramSocket::at_port(arguments.velocity_port);
    const TwinTotals totals = run(arguments, twin, velocity);
    fmt::print("twin: {} states sent, {} commands obeyed, {} refused, {} writers of commands seen at most\n",
               totals.states, twin.obeyed_frames(), twin.refused_frames(), totals.most_writers);
    return 0;
  } catch (const std::exception& error) {
    fmt::print(stderr, "duet-g1-twin: {}\n", error.what());
    return 2;
  }
}
