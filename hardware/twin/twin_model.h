// A stand-in for the robot at its wire: joints that follow their gains, arms that weigh while they are held, a root
// that follows a velocity with lag, delay and drift, the remote control. It has no gait and does not fall: it proves
// protocols, not walking. With an engine (TwinOptions::engine) its body is simulated instead: what the wire commands is
// all that holds it up. The same seed and calls give the same frames. One owner, one thread.
#pragma once

#include <deque>
#include <memory>
#include <span>
#include <string>

#include "duet/backends/backend.h"
#include "duet/controllers/root_conversion.h"
#include "duet/core/numbers.h"
#include "duet/hardware/wire/low_level_frame.h"
#include "duet/hardware/wire/robot_wire.h"
#include "duet/robots/dynamics.h"
#include "duet/robots/human_body.h"
#include "duet/robots/kinematics.h"
#include "duet/robots/robot_model.h"

namespace duet {

// The twin's body in an engine of backends/: the wire's commands are the motors' law there, and what the sensors of the
// robot would read comes back. It hangs on a rope until somebody lets it down: a robot that is limp or damped lies on
// the floor otherwise. One owner, one thread.
class TwinPhysics {
 public:
  // Standing in the neutral pose at the origin, the rope taut. `person`: who can be touched; without capsules nobody.
  // Throws as make_backend.
  TwinPhysics(const std::string& engine, std::shared_ptr<const RobotModel> robot, double dt,
              const HumanBody& person = {});

  // One step of `dt` under the motors' law kp (q* - q) + kd (dq* - v) + tau; a motor whose mode is not 1 gives nothing.
  // The frame's numbers are finite and its gains not below 0. A twin that has diverged stays where it was.
  void step(const LowCommandFrame& command);

  // Where the person is now and how they go on [m], [m/s]; throws as Backend::set_partner.
  void move_person(const HumanJoints& joints, const HumanJoints& velocities) {
    backend_->set_partner(joints, velocities);
  }

  // How much of the rope is in use: 1 holds it where it hung when that was last 0, 0 is slack.
  void hang(double share);
  [[nodiscard]] double hanging() const { return hanging_; }

  [[nodiscard]] const RobotState& state() const { return backend_->state(); }
  [[nodiscard]] const Eigen::VectorXd& torques() const { return backend_->torques(); }
  [[nodiscard]] std::span<const Contact> contacts() const { return backend_->contacts(); }  // of the last step
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

struct TwinOptions {
  double lag = 0.35;                // of the root's speed [s]
  double delay = 0.1;               // of its command [s]
  double drift = 0.0;               // of odometry [m/s]
  double place_noise = 0.0;         // of odometry, standard deviation [m]
  double speed_noise = 0.0;         // [m/s]
  double joint_noise = 0.0;         // of the measured angles [rad]
  double joint_speed_noise = 0.0;   // [rad/s]
  double gyro_noise = 0.0;          // [rad/s]
  double acceleration_noise = 0.0;  // [m/s^2]
  double tilt_noise = 0.0;          // of the IMU's orientation, about its x and y [rad]
  int mode_machine = 5;
  std::uint64_t seed = 1;
  std::string engine =
      {};  // of backends/ that simulates its body; empty: the first-order one. Steps are then kTwinPeriod
};

// A twin with the noise of a robot of this kind, as far as published training noise and data sheets go; `share` of it.
TwinOptions noisy_twin(double share, const std::string& engine, std::uint64_t seed);

inline constexpr double kTwinPeriod = 0.002;  // of states and of an engine's steps [s]

// Conditions that a script may change.
struct TwinCondition {
  double casing = 35.0, winding = 40.0;  // [degrees C]
  double roll = 0.0;                     // of the base [rad]
  double joint_speed = 0.0;              // added to a joint's reported speed [rad/s]
  double gyro = 0.0;                     // added to the reported rate [rad/s]
  double charge = 90.0;                  // of the battery [%]
  double voltage = 48.0;                 // that its motors report [V]
  bool motor_error = false;
  int mode_pr = 0;
  int mode_machine_offset = 0;
  bool hangs = false;  // on a rope, in the first-order body: its legs carry nothing
};

class TwinModel {
 public:
  // Throws std::invalid_argument for a robot without the G1's motors, and for an option that is negative or not finite;
  // as make_backend for an engine.
  TwinModel(std::shared_ptr<const RobotModel> robot, const TwinOptions& options);

  // A frame with a wrong checksum, for another robot, with numbers that are not finite or gains below 0 is counted and
  // not obeyed.
  void obey(const LowCommandFrame& frame);
  void obey(const VelocityCommand& velocity) { asked_ = velocity; }
  // A person who can be touched, before the first step. Throws std::invalid_argument without an engine, and later.
  void meet(const HumanBody& person);
  // Throws std::invalid_argument for another dt than the engine's.
  void step(double dt);
  // With the next tick. Without version, sensors and reserved words, which are 0, as the temperature of an IMU is.
  void write_state(LowStateFrame& frame);
  // The second IMU, on the link that pushes reach (the trunk): its own orientation and rate, the base's acceleration in
  // its axes, and noise of its own.
  void write_trunk_imu(ImuFrame& imu);
  [[nodiscard]] OdometrySample odometry(double now);

  RemoteControl remote{.heard = true};
  TwinCondition condition;
  [[nodiscard]] const RobotModel& robot() const { return *robot_; }
  [[nodiscard]] const Eigen::VectorXd& q() const { return q_; }
  [[nodiscard]] const Pose& root() const { return X_WB_; }
  [[nodiscard]] double time() const { return time_; }              // stepped so far [s]
  [[nodiscard]] TwinPhysics* physics() { return physics_.get(); }  // null: first-order
  [[nodiscard]] double root_speed() const { return v_WB_.head<2>().norm(); }
  [[nodiscard]] std::uint32_t tick() const { return tick_; }  // of the last state written
  [[nodiscard]] long refused_frames() const { return refused_; }
  [[nodiscard]] long obeyed_frames() const { return obeyed_; }
  [[nodiscard]] const LowCommandFrame& last_command() const { return command_; }

 private:
  void stand_on_feet();
  void step_joints(double dt);
  void step_root(double dt);
  void step_body(double dt);
  // For an IMU with the axes S, which leans by `roll` about its x.
  void write_imu(const Eigen::Quaterniond& R_WS, double roll, const Eigen::Vector3d& w_WS_S,
                 const Eigen::Vector3d& force_S, Random& random, ImuFrame& imu) const;

  std::shared_ptr<const RobotModel> robot_;
  TwinOptions options_;
  Random random_, trunk_random_;
  Kinematics kinematics_;
  Eigen::MatrixXd turning_;  // angular Jacobian of the trunk
  Eigen::VectorXd q_, v_, a_, tau_;
  // Torques of the first-order body: of gravity; of the legs, while their motors hold it on its feet [N m].
  Dynamics dynamics_;
  Eigen::VectorXd weight_, standing_;
  Pose X_WB_;
  Eigen::Vector3d v_WB_ = Eigen::Vector3d::Zero();           // [m/s]
  Eigen::Vector3d w_WB_B_ = Eigen::Vector3d::Zero();         // [rad/s]
  Eigen::Vector3d specific_force_B_ = {0.0, 0.0, kGravity};  // [m/s^2]
  Eigen::Vector2d speed_ = Eigen::Vector2d::Zero();          // asked for and lagging, in the heading frame [m/s]
  double yaw_rate_ = 0.0, drifted_ = 0.0, time_ = 0.0;
  std::unique_ptr<TwinPhysics> physics_;
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
