#include "duet/hardware/robot_connection.h"

namespace duet {

double RobotConnection::executor_heard(double now) {
  executor_.poll(now);
  return executor_.answers() ? executor_.heard_at() : kNever;
}

bool RobotConnection::take(LowStateFrame& frame) {
  if (!wire_.take(frame)) return false;
  if (odometry_ != nullptr) odometry_->see(frame);
  return true;
}

}  // namespace duet
