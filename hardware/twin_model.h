// A stand-in for the robot at its wire: joints that follow their gains, a root that follows a velocity with lag, delay
// and drift, the remote control. It has no gait and does not fall: it proves protocols, not walking. The same seed and
// calls give the same frames. One owner, one thread.
#pragma once

#include <deque>
#include <memory>
#include <string>

#include "duet/controllers/root_conversion.h"
#include "duet/core/random.h"
#include "duet/hardware/low_level_frame.h"
#include "duet/hardware/odometry.h"
#include "duet/robots/robot_model.h"

namespace duet {

struct TwinOptions {
  double lag = 0.35;         // of the root's speed [s]
  double delay = 0.1;        // of its command [s]
  double drift = 0.0;        // of odometry [m/s]
  double place_noise = 0.0;  // of odometry, standard deviation [m]
  double speed_noise = 0.0;  // [m/s]
  double joint_noise = 0.0;  // of the measured angles [rad]
  int mode_machine = 5;
  std::uint64_t seed = 1;
};

// What a script may change.
struct TwinCondition {
  double casing = 35.0, winding = 40.0;  // [degrees C]
  double roll = 0.0;                     // of the base [rad]
  double joint_speed = 0.0;              // added to a joint's reported speed [rad/s]
  double gyro = 0.0;                     // added to the reported rate [rad/s]
  double charge = 90.0;                  // of the battery [%]
  bool motor_error = false;
  int mode_pr = 0;
  int mode_machine_offset = 0;
};

class TwinModel {
 public:
  // Throws std::invalid_argument for a robot without the G1's motors, and for an option that is negative or not finite.
  TwinModel(std::shared_ptr<const RobotModel> robot, const TwinOptions& options);

  // A frame with a wrong checksum, or for another robot, is counted and not obeyed.
  void obey(const LowCommandFrame& frame);
  void obey(const VelocityCommand& velocity) { asked_ = velocity; }
  void step(double dt);
  void write_state(LowStateFrame& frame);  // with the next tick
  [[nodiscard]] OdometrySample odometry(double now);

  RemoteControl remote{.heard = true};
  TwinCondition condition;
  [[nodiscard]] const Eigen::VectorXd& q() const { return q_; }
  [[nodiscard]] const Pose& root() const { return X_WB_; }
  [[nodiscard]] double root_speed() const { return speed_.norm(); }
  [[nodiscard]] long refused_frames() const { return refused_; }
  [[nodiscard]] long obeyed_frames() const { return obeyed_; }
  [[nodiscard]] const LowCommandFrame& last_command() const { return command_; }

 private:
  void step_joints(double dt);
  void step_root(double dt);

  std::shared_ptr<const RobotModel> robot_;
  TwinOptions options_;
  Random random_;
  Eigen::VectorXd q_, v_, tau_;
  Pose X_WB_;
  Eigen::Vector2d speed_ = Eigen::Vector2d::Zero();  // in the heading frame [m/s]
  double yaw_rate_ = 0.0, drifted_ = 0.0, time_ = 0.0;
  VelocityCommand asked_;
  struct LateCommand {
    double at;
    VelocityCommand velocity;
  };
  std::deque<LateCommand> late_;
  LowCommandFrame command_{};
  std::uint32_t tick_ = 0;
  long refused_ = 0, obeyed_ = 0;
};

}  // namespace duet
