// A guard and a twin with a wire in memory and a simulated clock, for tests: 500 ticks a second, a planner at 50 Hz, a
// person at 30 Hz, and a place for faults on the way.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <deque>
#include <functional>
#include <limits>

#include "duet/hardware/guard/robot_guard.h"
#include "duet/hardware/twin/twin_model.h"
#include "duet/hardware/wire/low_level_frame.h"
#include "tests/hardware/limited_robot.h"

namespace duet::test {

class MemoryTransport final : public FrameTransport {
 public:
  explicit MemoryTransport(TwinModel& twin) : twin_(twin) {}
  bool take(LowStateFrame& frame) override {
    if (states.empty()) return false;
    frame = states.front();
    states.pop_front();
    return true;
  }
  int foreign_writers() override { return foreign; }
  void open_writer() override { writer_ = true, ++opened; }
  void close_writer() override { writer_ = false; }
  [[nodiscard]] bool has_writer() const override { return writer_; }
  bool write(const LowCommandFrame& frame) override {
    if (!writer_ || broken) return false;
    ++written;
    twin_.obey(frame);
    return true;
  }

  std::deque<LowStateFrame> states;
  int foreign = 0, opened = 0;
  bool broken = false;  // nothing leaves
  long written = 0;

 private:
  TwinModel& twin_;
  bool writer_ = false;
};

class TwinVelocity final : public VelocitySink {
 public:
  explicit TwinVelocity(TwinModel& twin) : twin_(twin) {}
  void send(const VelocityCommand& velocity) override {
    twin_.obey(velocity);
    last = velocity;
  }
  VelocityCommand last;

 private:
  TwinModel& twin_;
};

inline GuardSetup twin_guard(bool person = false) {
  GuardSetup setup;
  setup.limiter = person ? beside_an_adult() : nobody_near();
  setup.limiter.dt = 0.002;
  setup.stance = g1()->default_command(g1()->neutral);
  setup.dry_run = false;
  return setup;
}

struct GuardedTwin {
  explicit GuardedTwin(const GuardSetup& setup = twin_guard(), const TwinOptions& options = {})
      : twin(g1(), options), wire(twin), velocity(twin), guard(setup, wire, velocity) {
    message.command.q = g1()->neutral;
    message.command.root.height = 0.74;
    person.joints = standing_adult({4.0, 0.0, 0.95});
  }

  static constexpr double kDt = 0.002;
  static constexpr double kMostStep = 0.5 * kDt + 1e-6;  // of a target between two frames [rad]
  using Frames = std::deque<LowStateFrame>;

  // The robot's half of a tick.
  void step_twin() {
    twin.step(kDt);
    LowStateFrame frame;
    twin.write_state(frame);
    Frames sent{frame};
    if (spoil) spoil(sent);
    wire.states.insert(wire.states.end(), sent.begin(), sent.end());
  }
  void tick() {
    now += kDt;
    ++ticks;
    step_twin();
    if (plans && ticks % 10 == 0) plan();
    if (sees && ticks % 17 == 0) see();
    if (measures) guard.receive(twin.odometry(now));
    guard.tick(now);
    note();
  }
  void plan() {
    ++message.sequence;
    message.command.stamp = now;
    PlannerMessage sent = message;
    if (spoil_plan) spoil_plan(sent);
    guard.receive(sent, now);
  }
  void see() {
    ++person.sequence;
    guard.receive(person, now);
  }
  void run_for(double seconds) {
    for (double left = seconds; left > 0.5 * kDt; left -= kDt) tick();
  }
  void hold_key(RemoteKey key) { twin.remote.keys |= static_cast<std::uint16_t>(1u << static_cast<int>(key)); }
  void drop_key(RemoteKey key) { twin.remote.keys &= static_cast<std::uint16_t>(~(1u << static_cast<int>(key))); }
  // As an operator would: dead-man held, armed, stood up, running.
  void start() {
    hold_key(RemoteKey::kR1);
    run_for(2.2);
    guard.arm();
    tick();
    hold_key(RemoteKey::kStart);
    run_for(0.1);
    drop_key(RemoteKey::kStart);
    run_for(1.0);
    hold_key(RemoteKey::kA);
    run_for(0.1);
    drop_key(RemoteKey::kA);
  }
  [[nodiscard]] SafetyState state() const { return guard.status().safety.state; }
  [[nodiscard]] StopCause cause() const { return guard.status().safety.cause; }
  // Until the state is left; how long that took [s].
  double time_to_leave(SafetyState from, double most = 4.0) {
    const double begin = now;
    while (state() == from && now - begin < most) tick();
    return now - begin;
  }

  // Keeps the worst of what was sent.
  void note() {
    const GuardStatus& status = guard.status();
    if (!status.sent) return;
    const LowCommandFrame& frame = status.frame;
    bad_frames += frame.crc == checksum_of(frame) ? 0 : 1;
    for (int j = 0; j < kG1Motors; ++j) note_motor(j, frame.motor[j], status.order.damps);
    last_damps = status.order.damps;
    last = frame;
    has_last = true;
  }
  void note_motor(int j, const MotorCommandFrame& motor, bool damps) {
    const RobotJoint& joint = g1()->joints[j];
    const bool finite = std::isfinite(motor.q) && std::isfinite(motor.kp) && std::isfinite(motor.kd);
    if (!finite || motor.dq != 0.0f || !carries_within_its_share(j, motor)) ++bad_frames;
    if (damps) {
      if (motor.kp != 0.0f || motor.kd != 8.0f) ++bad_frames;
      return;
    }
    if (motor.q < joint.lower - 0.03 || motor.q > joint.upper + 0.03) ++bad_frames;
    const bool follows = has_last && !last_damps;
    const double rate = follows ? motor.q - last.motor[j].q : std::numeric_limits<double>::quiet_NaN();
    if (follows) largest_step = std::max(largest_step, std::abs(rate));
    if (follows && std::abs(rate) > kMostStep) ++fast_targets;
    if (follows && std::isfinite(rates[j])) largest_change = std::max(largest_change, std::abs(rate - rates[j]));
    rates[j] = rate;
  }

  // What is fed forward is none of a joint that the limiter does not move, and takes no arm past its share of effort.
  [[nodiscard]] bool carries_within_its_share(int j, const MotorCommandFrame& motor) const {
    const LimiterSetup& limiter = guard.setup().limiter;
    if (std::ranges::find(limiter.executed.joints, j) == limiter.executed.joints.end()) return motor.tau == 0.0f;
    const RobotState& state = guard.reading().state;
    const double by_gains = motor.kp * (motor.q - state.q[j]) - motor.kd * state.v[j];
    const double most = std::max(std::abs(by_gains), limiter.limits.torque_share * g1()->joints[j].effort);
    return std::abs(by_gains + motor.tau) <= most + 1e-3;  // numbers on the wire are short
  }

  TwinModel twin;
  MemoryTransport wire;
  TwinVelocity velocity;
  RobotGuard guard;
  PlannerMessage message;
  PersonMessage person;
  std::function<void(Frames&)> spoil;
  std::function<void(PlannerMessage&)> spoil_plan;
  bool plans = true, sees = true, measures = true;
  double now = 1000.0;
  long ticks = 0;
  // Counts over all frames that were sent.
  long bad_frames = 0;
  long fast_targets = 0;        // beyond kMostStep
  double largest_step = 0.0;    // of a target between two frames [rad]
  double largest_change = 0.0;  // of that step [rad]
  std::array<double, kG1Motors> rates{};
  LowCommandFrame last{};
  bool has_last = false, last_damps = false;
};

}  // namespace duet::test
