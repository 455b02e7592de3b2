#include "duet/hardware/guard_loop.h"

#include <time.h>

#include <cmath>

#include "duet/hardware/guard_message.h"
#include "duet/hardware/lcm_message.h"

namespace duet {
namespace {

constexpr int kVelocityEvery = 10;  // ticks: 50 Hz
constexpr int kMostMessages = 32;   // of a tick: who sends more does not stop the guard

void sleep_until(double seconds) {
  timespec at{};
  at.tv_sec = static_cast<time_t>(seconds);
  at.tv_nsec = static_cast<long>((seconds - std::floor(seconds)) * 1e9);
  while (clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &at, nullptr) != 0) {
  }
}

}  // namespace

bool take_messages(DatagramSocket& socket, RobotGuard& guard, GuardMessage& message, double now) {
  GuardBuffer buffer;
  bool planned = false;
  for (int k = 0; k < kMostMessages; ++k) {
    const std::size_t size = socket.receive(buffer);
    if (size == 0) break;
    switch (decode(std::span<const std::byte>(buffer).first(size), message)) {
      case GuardMessageKind::kPlanner:
        guard.receive(message.planner, now);
        planned = true;
        break;
      case GuardMessageKind::kPerson:
        guard.receive(message.person, now);
        break;
      case GuardMessageKind::kStop:
        guard.stop();
        planned = true;
        break;
      case GuardMessageKind::kRefused:
        break;
    }
  }
  return planned;
}

void take_readings(RobotWire& wire, RobotGuard& guard, double now) {
  OdometrySample odometry;
  if (wire.take(odometry)) {
    odometry.at = now;
    guard.receive(odometry);
  }
  BatteryReading battery;
  if (wire.take(battery)) guard.receive(battery, now);
  if (const double heard = wire.executor_heard(now); heard != kNever) guard.executor_heard(heard);
}

void LcmVelocity::send(const VelocityCommand& velocity) {
  if (calls_++ % kVelocityEvery != 0) return;
  LcmBuffer buffer;
  const PedalCommand pedal{{velocity.forward, velocity.lateral, velocity.yaw_rate, velocity.height}};
  (void)socket_.send(std::span<const std::byte>(buffer).first(encode(pedal, sequence_++, buffer)));
}

void run_guard(RobotGuard& guard, RobotWire& wire, DatagramSocket* planner, double period,
               const std::function<bool(double now)>& go_on) {
  GuardMessage message;
  double next = monotonic_seconds();
  double now = next;
  do {
    next += period;
    // After a pause it does not catch up: the state machine has to see how late it is, once.
    if (next < monotonic_seconds() - period) next = monotonic_seconds();
    sleep_until(next);
    if (planner != nullptr) take_messages(*planner, guard, message, monotonic_seconds());
    take_readings(wire, guard, monotonic_seconds());
    now = monotonic_seconds();
    guard.tick(now);
  } while (go_on(now));
}

}  // namespace duet
