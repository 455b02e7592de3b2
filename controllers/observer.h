// The numbers that the channels of an IO descriptor show of what a controller senses. Nothing allocates after
// construction.
#pragma once

#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "duet/controllers/descriptor.h"
#include "duet/controllers/root_conversion.h"
#include "duet/core/robot_state.h"
#include "duet/io/observation.h"
#include "duet/robots/kinematics.h"

namespace duet {

// How the reference moves, from its values one tick apart: it has no velocities of its own.
class ReferenceRates {
 public:
  ReferenceRates(int joints, double dt) : dt_(dt), qd_(Eigen::VectorXd::Zero(joints)) {}
  void reset() { seen_ = false; }
  void update(const Reference& reference);  // the first after a reset: at rest

  [[nodiscard]] const Eigen::Vector3d& v_WB() const { return v_WB_; }      // [m/s]
  [[nodiscard]] const Eigen::Vector3d& w_WB_B() const { return w_WB_B_; }  // [rad/s]
  [[nodiscard]] const Eigen::VectorXd& qd() const { return qd_; }          // [rad/s]

 private:
  double dt_;
  bool seen_ = false;
  Reference last_;
  Eigen::Vector3d v_WB_ = Eigen::Vector3d::Zero(), w_WB_B_ = Eigen::Vector3d::Zero();
  Eigen::VectorXd qd_;
};

// All that a channel can show at a tick; borrowed.
struct Senses {
  const RobotState& state;
  const Reference& reference;
  const ReferenceRates& rates;
  const VelocityCommand& command;
  std::span<const float> action;  // the network's last output
  long tick = 0;                  // of the network's, since reset
  const StandGate& gate;          // where it is told to stand, `command` has no velocity
  double period = kTick;          // of the network's ticks [s]
};

class Observer {
 public:
  // `robot_joints`: index in the robot of each of the descriptor's joints. Throws std::invalid_argument for a frame
  // that the robot lacks.
  Observer(const Descriptor& descriptor, std::shared_ptr<const RobotModel> robot, std::vector<int> robot_joints);

  void reset() { writer_.reset(); }
  void update(const Senses& senses);
  // Numbers of the input in the order of the descriptor's, after the last update.
  [[nodiscard]] std::span<const float> input(int index) const { return writer_.input(index); }

 private:
  void show(const Channel& channel, const Senses& senses, ChannelWriter& out) const;
  void show_joints(const Channel& channel, const Senses& senses, ChannelWriter& out) const;
  void show_frames(const Channel& channel, const Senses& senses, ChannelWriter& out) const;
  void show_anchor(const Channel& channel, ChannelWriter& out) const;
  [[nodiscard]] Eigen::Quaterniond sensor_rotation(const Channel& channel, const RobotState& state) const;  // R_WF
  [[nodiscard]] Eigen::Vector3d sensor_rate(const Channel& channel, const RobotState& state) const;  // w_WF_F [rad/s]

  std::shared_ptr<const RobotModel> robot_;  // the kinematics' model
  std::vector<int> joints_;
  Eigen::VectorXd neutral_;  // per descriptor's joint
  std::vector<ActionRange> action_ranges_;
  bool anchored_ = false, placed_ = false;  // whether poses of the reference's, of the robot's links are needed
  Kinematics kinematics_, reference_kinematics_;
  ObservationWriter writer_;
};

// Angles of R_WB = Rz(yaw) Ry(pitch) Rx(roll) [rad]; the yaw is yaw_of.
Eigen::Vector2d roll_pitch_of(const Eigen::Quaterniond& R_WB);

}  // namespace duet
