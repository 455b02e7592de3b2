// The twin's body in an engine of backends/: the wire's commands are the motors' law there, and what the sensors of the
// robot would read comes back. It hangs on a rope until somebody lets it down: a robot that is limp or damped lies on
// the floor otherwise. One owner, one thread.
#pragma once

#include <memory>
#include <string>

#include "duet/backends/backend.h"
#include "duet/hardware/low_level_frame.h"
#include "duet/robots/kinematics.h"

namespace duet {

class TwinPhysics {
 public:
  // Standing in the neutral pose at the origin, the rope taut. Throws as make_backend.
  TwinPhysics(const std::string& engine, std::shared_ptr<const RobotModel> robot, double dt);

  // One step of `dt` under the motors' law kp (q* - q) + kd (dq* - v) + tau; a motor whose mode is not 1 gives nothing.
  // The frame's numbers are finite and its gains not below 0. A twin that has diverged stays where it was.
  void step(const LowCommandFrame& command);

  // How much of the rope is in use: 1 holds it where it hung when that was last 0, 0 is slack.
  void hang(double share);
  [[nodiscard]] double hanging() const { return hanging_; }

  [[nodiscard]] const RobotState& state() const { return backend_->state(); }
  [[nodiscard]] const Eigen::VectorXd& torques() const { return backend_->torques(); }
  // The reading of an accelerometer in the base [m/s^2], frame B.
  [[nodiscard]] Eigen::Vector3d specific_force() const;
  [[nodiscard]] bool diverged() const { return diverged_; }
  [[nodiscard]] double dt() const { return backend_->scene().dt; }

 private:
  void pull();

  std::shared_ptr<const RobotModel> robot_;
  std::unique_ptr<Backend> backend_;
  Kinematics kinematics_;
  JointCommand command_;
  Eigen::MatrixXd jacobian_;
  int hook_ = 0;                         // the link that the rope is at
  Eigen::Vector3d anchor_W_, v_before_;  // of the rope [m]; of the base before the last step [m/s]
  double hanging_ = 1.0;
  bool diverged_ = false;
};

}  // namespace duet
