#include "duet/hardware/twin_in_process.h"

#include <utility>

namespace duet {
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
  if (open_) twin_.obey(frame);
  return open_;
}

TwinInProcess::TwinInProcess(const GuardSetup& setup, const TwinOptions& options, std::unique_ptr<Walker> walker,
                             RunLog* log, std::vector<TwinFault> faults)
    : twin_(setup.limiter.robot, options),
      faulty_(twin_, std::move(faults), options.seed),
      wire_(twin_),
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

void TwinInProcess::tick() {
  operator_.tick(twin_.time(), twin_);
  twin_.step(kTwinPeriod);
  LowStateFrame frame;
  if (faulty_.next_state(twin_.time(), frame)) wire_.states.push_back(frame);
  OdometrySample odometry = twin_.odometry(twin_.time());
  odometry.X_WB.p = as_sent(odometry.X_WB.p);
  odometry.v_WB = as_sent(odometry.v_WB);
  guard_.receive(odometry);
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
