#include "duet/hardware/robot_connection.h"

namespace duet {

void RobotConnection::poll(double now, RobotGuard& guard) {
  executor_.poll(now);
  if (executor_.answers()) guard.executor_heard(executor_.heard_at());
  BatteryReading battery;
  if (wire_.take(battery)) guard.receive(battery, now);
}

bool RobotConnection::take(LowStateFrame& frame) {
  if (!wire_.take(frame)) return false;
  if (odometry_ != nullptr) odometry_->see(frame);
  return true;
}

}  // namespace duet
