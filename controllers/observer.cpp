#include "duet/controllers/observer.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "duet/core/robot_state.h"

namespace duet {
namespace {

bool is_anchor(const Channel& channel) {
  return channel.kind == ChannelKind::kAnchorPositionError || channel.kind == ChannelKind::kAnchorOrientationError;
}

void write_axes(const Channel& channel, const Eigen::Vector3d& v, ChannelWriter& out) {
  if (channel.axes.empty()) return out(v);
  for (const int axis : channel.axes) out(v[axis]);
}

void write_waves(const Channel& channel, const Senses& senses, double (*wave)(double), ChannelWriter& out) {
  const bool silent = channel.gait.silent && senses.gate.stands();
  for (size_t i = 0; i < channel.gait.phases.size(); ++i)
    out(silent ? 0.0 : wave(gait_angle(channel.gait, i, senses.tick, senses.gate, senses.period)));
}

// The velocity of a point fixed to the base, in the base's axes.
Eigen::Vector3d point_velocity(const RobotState& state, const Eigen::Vector3d& p_BF) {
  return state.X_WB.R.conjugate() * state.v_WB + state.w_WB_B.cross(p_BF);
}

// In the axes of the reference's root.
Eigen::Vector3d root_velocity(const Senses& senses) {
  return senses.reference.X_WB.R.conjugate() * senses.rates.v_WB();
}

bool is_sensed(const Channel& channel) {
  return channel.kind == ChannelKind::kBaseAngularVelocity || channel.kind == ChannelKind::kGravity;
}

// Where the gyro of a channel sits: in the frame that it names, else in the card's; -1: in the base, with its axes.
int sensor_frame(const Channel& channel, const RobotModel& robot) {
  if (!is_sensed(channel)) return -1;
  const int frame = channel.frame.empty() ? robot.roles.imu_frame : robot.frame_index(channel.frame);
  const RobotFrame& found = robot.frames[frame];
  return found.link == 0 && found.X_LF.R.isApprox(Eigen::Quaterniond::Identity(), 0.0) ? -1 : frame;
}

// With the index of each channel's frame.
ObservationLayout bound_layout(const ObservationLayout& layout, const RobotModel& robot) {
  ObservationLayout bound = layout;
  for (ChannelGroup& group : bound.groups)
    for (Channel& channel : group.channels)
      channel.frame_index = is_anchor(channel) ? robot.frame_index(channel.frame) : sensor_frame(channel, robot);
  return bound;
}

}  // namespace

Eigen::Vector2d roll_pitch_of(const Eigen::Quaterniond& R_WB) {
  const double sine = 2.0 * (R_WB.w() * R_WB.y() - R_WB.z() * R_WB.x());
  return {std::atan2(2.0 * (R_WB.w() * R_WB.x() + R_WB.y() * R_WB.z()),
                     1.0 - 2.0 * (R_WB.x() * R_WB.x() + R_WB.y() * R_WB.y())),
          std::asin(std::clamp(sine, -1.0, 1.0))};
}

void ReferenceRates::update(const Reference& reference) {
  if (!seen_) last_ = reference;
  seen_ = true;
  v_WB_ = (reference.X_WB.p - last_.X_WB.p) / dt_;
  const Eigen::AngleAxisd turn((last_.X_WB.R.conjugate() * reference.X_WB.R).normalized());
  w_WB_B_ = std::remainder(turn.angle(), 2.0 * std::numbers::pi) / dt_ * turn.axis();
  qd_ = (reference.q - last_.q) / dt_;
  last_ = reference;
}

Observer::Observer(const Descriptor& descriptor, std::shared_ptr<const RobotModel> robot, std::vector<int> robot_joints)
    : robot_(std::move(robot)),
      joints_(std::move(robot_joints)),
      neutral_(descriptor.joints.size()),
      action_ranges_(descriptor.action_ranges()),
      kinematics_(*robot_),
      reference_kinematics_(*robot_),
      writer_(bound_layout(descriptor.observation, *robot_), descriptor.widths()) {
  for (Eigen::Index j = 0; j < neutral_.size(); ++j) neutral_[j] = descriptor.joints[j].neutral;
  for (const ChannelGroup& group : descriptor.observation.groups)
    for (const Channel& channel : group.channels) {
      anchored_ |= is_anchor(channel);
      placed_ |= is_anchor(channel) || sensor_frame(channel, *robot_) >= 0;
    }
}

void Observer::update(const Senses& senses) {
  if (placed_) kinematics_.update(senses.state.X_WB, senses.state.q);
  if (anchored_) reference_kinematics_.update(senses.reference.X_WB, senses.reference.q);
  writer_.update([&](const Channel& channel, ChannelWriter& out) { show(channel, senses, out); });
}

void Observer::show(const Channel& channel, const Senses& senses, ChannelWriter& out) const {
  const RobotState& state = senses.state;
  const Reference& reference = senses.reference;
  switch (channel.kind) {
    case ChannelKind::kBaseLinearVelocity:
      return write_axes(channel, point_velocity(state, channel.offset), out);
    case ChannelKind::kBaseAngularVelocity:
      return write_axes(channel, sensor_rate(channel, state), out);
    case ChannelKind::kGravity:
      return write_axes(channel, sensor_rotation(channel, state).conjugate() * -Eigen::Vector3d::UnitZ(), out);
    case ChannelKind::kRollPitch:
      return out(roll_pitch_of(state.X_WB.R));
    case ChannelKind::kRollPitchYaw: {
      const Eigen::Vector2d tilt = roll_pitch_of(state.X_WB.R);
      return write_axes(channel, {tilt.x(), tilt.y(), yaw_of(state.X_WB.R)}, out);
    }
    case ChannelKind::kCommandVelocity:
      return write_axes(channel, {senses.command.forward, senses.command.lateral, senses.command.yaw_rate}, out);
    case ChannelKind::kCommandHeight:
      return out(senses.command.height);
    case ChannelKind::kCommandStand:
      return out(senses.gate.stands() ? 0.0 : 1.0);
    case ChannelKind::kPreviousAction:
      for (size_t a = 0; a < senses.action.size(); ++a) {
        const ActionRange range = channel.clipped ? action_ranges_[a] : ActionRange{};
        out(std::clamp<double>(senses.action[a], range.lower, range.upper));
      }
      return;
    case ChannelKind::kReferenceRootVelocity:
      return write_axes(channel, root_velocity(senses), out);
    case ChannelKind::kReferenceHeight:
      return out(reference.X_WB.p.z());
    case ChannelKind::kReferenceRollPitch:
      return out(roll_pitch_of(reference.X_WB.R));
    case ChannelKind::kReferenceYawRate:
      return out(senses.rates.w_WB_B().z());
    case ChannelKind::kReferenceFrames:
      return show_frames(channel, senses, out);
    case ChannelKind::kAnchorPositionError:
    case ChannelKind::kAnchorOrientationError:
      return show_anchor(channel, out);
    case ChannelKind::kGaitSine:
      return write_waves(channel, senses, std::sin, out);
    case ChannelKind::kGaitCosine:
      return write_waves(channel, senses, std::cos, out);
    case ChannelKind::kTick:
      return out(static_cast<double>(senses.tick));
    case ChannelKind::kConstant:
      for (const double value : channel.values) out(value);
      return;
    default:
      return show_joints(channel, senses, out);
  }
}

void Observer::show_joints(const Channel& channel, const Senses& senses, ChannelWriter& out) const {
  for (size_t k = 0; k < channel.joints.size(); ++k) {
    const int j = channel.joints[k];
    const int r = joints_[j];
    if (channel.kind == ChannelKind::kJointPosition)
      out(channel.zeroed[k] ? 0.0 : senses.state.q[r] - neutral_[j]);
    else if (channel.kind == ChannelKind::kJointVelocity)
      out(channel.zeroed[k] ? 0.0 : senses.state.v[r]);
    else if (channel.kind == ChannelKind::kReferenceJointAngle)
      out(senses.reference.q[r]);
    else
      out(senses.rates.qd()[r]);
  }
}

// A controller is given the reference of the present tick alone: what comes after it is taken to go on as it is (the
// same pose of the joints, the same velocities, roll, pitch and height).
void Observer::show_frames(const Channel& channel, const Senses& senses, ChannelWriter& out) const {
  for (size_t step = 0; step < channel.steps.size(); ++step) {
    out(senses.reference.X_WB.p.z());
    out(roll_pitch_of(senses.reference.X_WB.R));
    out(root_velocity(senses));
    out(senses.rates.w_WB_B().z());
    for (const int j : channel.joints) out(senses.reference.q[joints_[j]]);
  }
}

void Observer::show_anchor(const Channel& channel, ChannelWriter& out) const {
  const int frame = channel.frame_index;
  const Pose error = kinematics_.frame_pose(frame).inverse() * reference_kinematics_.frame_pose(frame);
  if (channel.kind == ChannelKind::kAnchorPositionError) return out(error.p);
  const Eigen::Matrix3d R = error.R.toRotationMatrix();
  for (int row = 0; row < 3; ++row) out(R.row(row).head<2>());
}

Eigen::Quaterniond Observer::sensor_rotation(const Channel& channel, const RobotState& state) const {
  return channel.frame_index < 0 ? state.X_WB.R : kinematics_.frame_pose(channel.frame_index).R;
}

// The base's rate and those of the hinges between it and the frame.
Eigen::Vector3d Observer::sensor_rate(const Channel& channel, const RobotState& state) const {
  if (channel.frame_index < 0) return state.w_WB_B;
  Eigen::Vector3d w_WF = state.X_WB.R * state.w_WB_B;
  for (int link = robot_->frames[channel.frame_index].link; link > 0; link = robot_->links[link].parent)
    w_WF += state.v[link - 1] * (kinematics_.R_WL(link) * robot_->links[link].axis);
  return kinematics_.frame_pose(channel.frame_index).R.conjugate() * w_WF;
}

}  // namespace duet
