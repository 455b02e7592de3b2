#include "duet/hardware/guard/guard_loop.h"

#include <fmt/format.h>
#include <sched.h>
#include <sys/prctl.h>
#include <time.h>

#include <chrono>
#include <cmath>
#include <filesystem>
#include <thread>

#include "duet/hardware/guard/guard_message.h"
#include "duet/hardware/wire/lcm_message.h"

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

void run_or_damp(RobotGuard& guard, const std::function<void()>& run,
                 const std::function<void(const std::exception&)>& damp) {
  try {
    run();
  } catch (const std::exception& error) {
    if (guard.status().order.writes) {
      guard.stop();
      damp(error);
    }
    throw;
  }
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
    // After a pause it does not catch up: the state machine has to see how late it is, once; and what came meanwhile
    // has a period to get here, before its age is told.
    if (next < monotonic_seconds() - period) next = monotonic_seconds() + period;
    sleep_until(next);
    if (planner != nullptr) take_messages(*planner, guard, message, monotonic_seconds());
    take_readings(wire, guard, monotonic_seconds());
    now = monotonic_seconds();
    guard.tick(now);
  } while (go_on(now));
}

namespace {

constexpr auto kReportLook = std::chrono::microseconds(100);  // between two looks for a report
constexpr int kLookEvery = 10;                                // reports between two looks for a planner

template <typename Message>
bool send_message(DatagramSocket& socket, const Message& message, GuardBuffer& buffer) {
  const std::size_t size = encode(message, buffer);
  return socket.send(std::span<const std::byte>(buffer).first(size));
}

}  // namespace

SocketGuardLink::SocketGuardLink(const std::string& socket, double patience)
    : socket_(socket),
      patience_(patience),
      to_(DatagramSocket::to_path(socket)),
      from_(DatagramSocket::at_path(report_path(socket))) {}

bool SocketGuardLink::send(const PlannerMessage& message) { return send_message(to_, message, buffer_); }
bool SocketGuardLink::send(const PersonMessage& message) { return send_message(to_, message, buffer_); }
bool SocketGuardLink::stop() {
  const std::size_t size = encode_stop(buffer_);
  return to_.send(std::span<const std::byte>(buffer_).first(size));
}

bool SocketGuardLink::next(GuardReport& report) {
  ReportBuffer buffer;
  const double begin = monotonic_seconds();
  while (monotonic_seconds() - begin < patience_) {
    const std::size_t size = from_.receive(buffer);
    if (size > 0 && decode(std::span<const std::byte>(buffer).first(size), report)) return true;
    if (size == 0) std::this_thread::sleep_for(kReportLook);
  }
  return false;
}

std::string SocketGuardLink::name() const { return fmt::format("the guard at '{}'", socket_); }

bool ReportSender::after_tick(const RobotGuard& guard) {
  if (++ticks_ % kReportEvery != 0) return false;
  if (planner_ == nullptr) {
    if (silent_-- > 0) return false;
    silent_ = kLookEvery;
    std::error_code error;
    if (!std::filesystem::exists(path_, error)) return false;
    try {
      planner_ = std::make_unique<DatagramSocket>(DatagramSocket::to_path(path_));
    } catch (const std::runtime_error&) {
      return false;
    }
  }
  fill_report(guard, report_);
  encode(report_, buffer_);
  if (planner_->send(buffer_)) return true;
  planner_.reset();  // gone, or so busy that its queue is full: the next report tries anew
  silent_ = 0;
  return false;
}

namespace {

constexpr int kPriority = 80;  // of 1 to 99: above usual programs and the kernel's own interrupt threads (50)

}  // namespace

void ask_for_sharp_timers() { (void)prctl(PR_SET_TIMERSLACK, 1UL, 0UL, 0UL, 0UL); }

bool ask_for_real_time() {
  ask_for_sharp_timers();
  const sched_param parameter{.sched_priority = kPriority};
  return sched_setscheduler(0, SCHED_FIFO, &parameter) == 0;
}

}  // namespace duet
