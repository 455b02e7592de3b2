#include "duet/hardware/twin/lock_step.h"

#include <chrono>
#include <thread>
#include <utility>

#include "duet/hardware/wire/low_level_frame.h"

namespace duet {
namespace {

constexpr auto kStepLook = std::chrono::microseconds(20);
constexpr double kResendAfter = 0.02;  // [s] of the wall, as all here
constexpr double kGiveUpAfter = 10.0;
constexpr double kPlannerPatience = 5.0;
constexpr double kTwinPatience = 0.2;
constexpr int kMostSilent = 5;  // states that did not come in time, until the twin counts as gone

void wait_a_moment() { std::this_thread::sleep_for(kStepLook); }

}  // namespace

bool LockStepWire::wait(double seconds) {
  const double begin = monotonic_seconds();
  LowStateFrame frame;
  while (!waits_ && monotonic_seconds() - begin < seconds) {
    if (!wire_.take(frame)) {
      wait_a_moment();
      continue;
    }
    if (frame.tick == tick_ && tick_ != 0) {
      if (answered_) (void)wire_.write(answer_);
      continue;
    }
    state_ = frame;
    tick_ = frame.tick;
    waits_ = true;
    answered_ = false;
  }
  return waits_;
}

bool LockStepWire::take(LowStateFrame& frame) {
  if (!waits_) return false;
  waits_ = false;
  frame = state_;
  return true;
}

void LockStepWire::close_writer() {
  answered_ = false;
  wire_.close_writer();
}

bool LockStepWire::write(const LowCommandFrame& frame) {
  answer_ = frame;
  answer_.reserve[0] = tick_;
  answer_.crc = checksum_of(answer_);
  answered_ = wire_.write(answer_);
  return answered_;
}

void run_guard_in_lock_step(RobotGuard& guard, LockStepWire& wire, DatagramSocket* planner, double period,
                            const LockStepCallbacks& callbacks) {
  GuardMessage message;
  guard.has_robots_clock();
  double now = 0.0;
  bool reported = false;
  int silent = 0;
  do {
    const bool came = wire.wait(silent < kMostSilent ? kTwinPatience : period);
    silent = came ? 0 : silent + 1;
    // A period for each state, also where some were missed before the twin waited for answers; and without a state
    // time goes on all the same, so that the state machine notices.
    now += period;
    if (planner != nullptr) {
      const double begin = monotonic_seconds();
      bool planned = take_messages(*planner, guard, message, now);
      while (reported && !planned && monotonic_seconds() - begin < kPlannerPatience) {
        wait_a_moment();
        planned = take_messages(*planner, guard, message, now);
      }
    }
    take_readings(wire, guard, now);
    guard.tick(now);
    reported = callbacks.report && callbacks.report();
  } while (callbacks.go_on(now));
}

bool LockStepTwin::await(const LowStateFrame& state, const std::function<void(const LowCommandFrame&)>& obey) {
  LowCommandFrame command;
  double sent_at = monotonic_seconds();
  const double begin = sent_at;
  do {
    while (wire_.take(command)) {
      locked_ = locked_ || (command.reserve[0] != 0 && command.crc == checksum_of(command));
      obey(command);
      if (command.reserve[0] == state.tick) return true;
    }
    if (!locked_) return false;
    wait_a_moment();
    const double now = monotonic_seconds();
    if (now - sent_at > kResendAfter) {
      locked_ = wire_.command_writers() > 0 && now - begin < kGiveUpAfter;
      wire_.write(state);
      sent_at = now;
    }
  } while (locked_);
  return false;
}

namespace {

// The value after the wire, whose numbers are short.
Eigen::Vector3d as_sent(const Eigen::Vector3d& value) { return value.cast<float>().cast<double>(); }

}  // namespace

bool TwinInProcess::Wire::take(LowStateFrame& frame) {
  if (states.empty()) return false;
  frame = states.front();
  states.pop_front();
  return true;
}

bool TwinInProcess::Wire::write(const LowCommandFrame& frame) {
  const bool leaves = open_ && trouble_.writes;
  if (leaves) twin_.obey(frame);
  return leaves;
}

TwinInProcess::TwinInProcess(const GuardSetup& setup, const TwinOptions& options, std::unique_ptr<Walker> walker,
                             RunLog* log, std::vector<TwinFault> faults)
    : twin_(setup.limiter.robot, options),
      faulty_(twin_, std::move(faults), options.seed),
      wire_(twin_, trouble),
      velocity_(twin_),
      guard_(setup, wire_, velocity_),
      walker_(std::move(walker)),
      log_(log) {
  if (walker_ != nullptr) guard_.let_walk(*walker_);
}

bool TwinInProcess::send(const PlannerMessage& message) {
  guard_.receive(message, twin_.time());
  return true;
}

bool TwinInProcess::send(const PersonMessage& message) {
  guard_.receive(message, twin_.time());
  return true;
}

bool TwinInProcess::stop() {
  guard_.stop();
  return true;
}

void TwinInProcess::step_twin() {
  operator_.tick(twin_.time(), twin_);
  twin_.step(kTwinPeriod);
  if (after_step) after_step();
  LowStateFrame frame;
  if (!faulty_.next_state(twin_.time(), frame)) return;
  if (trouble.spoil) {
    trouble.spoil(frame);
    seal(frame);
  }
  wire_.states.push_back(frame);
}

void TwinInProcess::pause(double seconds) {
  for (double left = seconds; left > 0.5 * kTwinPeriod; left -= kTwinPeriod) step_twin();
}

void TwinInProcess::tick() {
  step_twin();
  OdometrySample odometry = twin_.odometry(twin_.time());
  odometry.X_WB.p.x() += trouble.jump;
  odometry.X_WB.p = as_sent(odometry.X_WB.p);
  odometry.v_WB = as_sent(odometry.v_WB);
  if (trouble.odometry) guard_.receive(odometry);
  guard_.receive(BatteryReading{.charge = twin_.condition.charge}, twin_.time());
  if (guard_.status().safety.state == SafetyState::kReady) guard_.arm();
  guard_.tick(twin_.time());
  if (log_ != nullptr) log_->add(guard_);
}

bool TwinInProcess::next(GuardReport& report) {
  for (int k = 0; k < kReportEvery; ++k) tick();
  fill_report(guard_, report);
  return true;
}

}  // namespace duet
