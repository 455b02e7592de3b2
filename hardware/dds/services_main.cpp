// duet-g1-services: stand-ins for the programs on a robot that the executors speak to, beside `duet-g1-twin` in a
// domain that no robot has: HOMIE's two processes, or the maker's walking. They command the twin. Beside either, and
// alone, the maker's motion_switcher. docs/hardware.md, "Executors".
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <csignal>
#include <cstdio>
#include <optional>
#include <thread>

#include "duet/hardware/dds/dds_wire.h"
#include "duet/hardware/guard/guard_loop.h"
#include "duet/hardware/twin/fake_arms.h"
#include "duet/hardware/twin/fakes.h"
#include "duet/hardware/wire/datagram_socket.h"
#include "duet/hardware/wire/lcm_message.h"

namespace {

using namespace duet;  // a program of its own

constexpr int kPeriodUs = 5000;            // of its commands, as HOMIE's controller has it
constexpr int kPolicyEvery = 4;            // of these periods, as its policy has it
constexpr const char* kMakersMode = "ai";  // in which a G1 walks
constexpr Service kSwitched[] = {Service::kMotionSwitcher};
volatile std::sig_atomic_t services_stopped = 0;

struct ServicesArguments {
  DdsPlace place{-1, "lo"};
  LcmPlace lcm;
  std::uint16_t velocity_port = 0;
  double seconds = 0.0;
  bool homie = false, sport = false, switcher = false, echo = false;
  int fsm = kFsmStart;
};

// Writes to the twin: its motors' commands, and how it walks.
class TwinMotors {
 public:
  explicit TwinMotors(const ServicesArguments& arguments)
      : wire_(open_robot_wire(arguments.place)), velocity_(DatagramSocket::to_port(arguments.velocity_port)) {}

  // True where a state came.
  bool listen() {
    LowStateFrame state;
    bool came = false;
    while (wire_->take(state)) came = read_state(state, reading_) == FrameFault::kNone || came;
    return came;
  }
  void write(const LowCommandFrame& frame, const VelocityCommand& velocity) {
    wire_->open_writer();
    (void)wire_->write(frame);
    LcmBuffer buffer;
    const PedalCommand pedal{{velocity.forward, velocity.lateral, velocity.yaw_rate, velocity.height}};
    (void)velocity_.send(std::span<const std::byte>(buffer).first(encode(pedal, sequence_++, buffer)));
  }
  // Leaves the motors limp, and the topic to somebody else.
  void release() {
    LowCommandFrame limp;
    build_damping(0.0, machine(), limp);
    if (wire_->has_writer()) (void)wire_->write(limp);
    wire_->close_writer();
  }
  [[nodiscard]] const RobotReading& reading() const { return reading_; }
  [[nodiscard]] std::uint8_t machine() const { return reading_.mode_machine; }

 private:
  std::unique_ptr<RobotWire> wire_;
  DatagramSocket velocity_;
  RobotReading reading_;
  std::uint32_t sequence_ = 0;
};

// Calls `step` every 5 ms until the time is over or somebody stops it.
template <typename Step>
void every_period(const ServicesArguments& arguments, const Step& step) {
  const double begin = monotonic_seconds();
  auto next = std::chrono::steady_clock::now();
  for (double now = begin; services_stopped == 0 && (arguments.seconds <= 0.0 || now - begin < arguments.seconds);
       now = monotonic_seconds()) {
    step(now);
    next = std::max(next + std::chrono::microseconds(kPeriodUs), std::chrono::steady_clock::now());
    std::this_thread::sleep_until(next);
  }
}

void answer_switcher(ServicesWire& wire, FakeSwitcher& switcher) {
  RpcRequest request;
  while (wire.take(Service::kMotionSwitcher, request)) wire.respond(Service::kMotionSwitcher, switcher.answer(request));
}

void play_switcher(const ServicesArguments& arguments) {
  const std::unique_ptr<ServicesWire> wire = open_services(arguments.place, kSwitched);
  FakeSwitcher switcher;
  every_period(arguments, [&](double) { answer_switcher(*wire, switcher); });
}

void play_homie(const ServicesArguments& arguments) {
  TwinMotors motors(arguments);
  const std::unique_ptr<ServicesWire> wire = open_services(arguments.place, kSwitched);
  FakeSwitcher switcher;
  LcmChannel channel(arguments.lcm);
  FakeHomie homie;
  std::uint32_t sequence = 0;
  long periods = 0;
  every_period(arguments, [&](double now) {
    answer_switcher(*wire, switcher);
    LcmBuffer buffer;
    bool own = false;
    if (periods++ % kPolicyEvery == 0)
      (void)channel.send(std::span<const std::byte>(buffer).first(FakeHomie::write_targets(now, sequence++, buffer)));
    while (const std::size_t size = channel.receive(buffer, own))
      if (!own) homie.receive(std::span<const std::byte>(buffer).first(size), now);
    if (!motors.listen()) return;
    LowCommandFrame frame;
    homie.write_command(motors.machine(), frame);
    const std::array<double, 4>& v = homie.velocity();
    motors.write(frame, {v[0], v[1], v[2], v[3]});
    (void)channel.send(
        std::span<const std::byte>(buffer).first(FakeHomie::write_echo(motors.reading(), sequence++, buffer)));
  });
  const HomieTraffic& traffic = homie.traffic();
  fmt::print("homie: {} velocities, {} arm targets, {} refused, longest gap {:.3f} s\n", traffic.pedals, traffic.arms,
             traffic.refused, traffic.longest_gap);
}

void play_sport(const ServicesArguments& arguments) {
  TwinMotors motors(arguments);
  constexpr Service kServed[] = {Service::kSport, Service::kMotionSwitcher, Service::kArm};
  const std::unique_ptr<ServicesWire> wire = open_services(arguments.place, kServed);
  FakeSwitcher switcher(kMakersMode);
  const std::shared_ptr<const RobotModel> robot = load_shared_robot();
  FakeSport service(robot->default_command(robot->neutral), arguments.fsm);
  FakeArms arms(robot);
  long calls = 0;
  every_period(arguments, [&](double now) {
    answer_switcher(*wire, switcher);
    RpcRequest request;
    for (; wire->take(Service::kSport, request); ++calls)
      if (switcher.runs()) wire->respond(Service::kSport, service.answer(request, now));
    LowCommandFrame frame;
    while (wire->take_arms(frame)) {
      service.obey_arms(frame);
      arms.see_others(now);
    }
    for (; wire->take(Service::kArm, request); ++calls)
      if (switcher.runs()) wire->respond(Service::kArm, arms.answer(request, now, service.fsm()));
    if (!motors.listen()) return;
    if (!switcher.runs()) return motors.release();
    if (arms.write_arms(motors.machine(), now, frame)) service.obey_arms(frame);
    service.write_command(motors.machine(), frame);
    motors.write(frame, service.velocity(now));
  });
  fmt::print("sport: {} calls, {} refused, arm weight {:.2f}, state {}\n", calls, service.refused(),
             service.arm_weight(), service.fsm());
}

// Answers each command with a state that carries its first reserved word as the tick: for the round trip of a message.
void play_echo(const ServicesArguments& arguments) {
  const std::unique_ptr<TwinWire> wire = open_twin_wire(arguments.place);
  const double begin = monotonic_seconds();
  LowCommandFrame command;
  LowStateFrame state{};
  while (services_stopped == 0 && (arguments.seconds <= 0.0 || monotonic_seconds() - begin < arguments.seconds)) {
    if (!wire->wait(0.1)) continue;
    while (wire->take(command)) {
      state.tick = command.reserve[0];
      seal(state);
      wire->write(state);
    }
  }
}

}  // namespace

int main(int argc, char** argv) {
  ServicesArguments arguments;
  CLI::App app("Stand-ins for the programs on a G1 that `duet hw` commands, beside a twin. They have no gait.");
  app.add_option("--domain", arguments.place.domain, "of DDS, 100 to 199, or 1")->required();
  app.add_option("--velocity-port", arguments.velocity_port, "UDP port of 127.0.0.1 where the twin takes velocities");
  app.add_option("--lcm-port", arguments.lcm.port, "of the multicast group of LCM");
  app.add_option("--fsm", arguments.fsm, "state of the maker's machine at first");
  app.add_option("--seconds", arguments.seconds, "for which it runs; 0: until it is stopped");
  CLI::Option_group* what = app.add_option_group("what");
  what->add_flag("--homie", arguments.homie, "HOMIE's processes, over LCM on lo");
  what->add_flag("--sport", arguments.sport, "the maker's walking, its arm topic and its preset arm actions");
  what->add_flag("--switcher", arguments.switcher,
                 "the maker's motion_switcher alone, which says that no mode runs: a robot in debug mode");
  what->add_flag("--echo", arguments.echo, "answers every command with a state");
  what->require_option(1);
  CLI11_PARSE(app, argc, argv);
  std::signal(SIGINT, [](int) { services_stopped = 1; });
  std::signal(SIGTERM, [](int) { services_stopped = 1; });
  try {
    check_twin_place(arguments.place);
    (void)ask_for_real_time();
    if (arguments.homie) play_homie(arguments);
    if (arguments.sport) play_sport(arguments);
    if (arguments.switcher) play_switcher(arguments);
    if (arguments.echo) play_echo(arguments);
    return 0;
  } catch (const std::exception& error) {
    fmt::print(stderr, "duet-g1-services: {}\n", error.what());
    return 2;
  }
}
