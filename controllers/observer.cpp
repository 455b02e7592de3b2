#include "duet/controllers/observer.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "duet/core/clock.h"

namespace duet {
namespace {

bool is_anchor(const Channel& channel) {
  return channel.kind == ChannelKind::kAnchorPositionError || channel.kind == ChannelKind::kAnchorOrientationError;
}

void append(const Eigen::Vector3d& v, std::vector<double>& out) { out.insert(out.end(), {v.x(), v.y(), v.z()}); }

void append(const Channel& channel, const Eigen::Vector3d& v, std::vector<double>& out) {
  if (channel.axes.empty()) return append(v, out);
  for (const int axis : channel.axes) out.push_back(v[axis]);
}

void append(const Eigen::Vector2d& v, std::vector<double>& out) { out.insert(out.end(), {v.x(), v.y()}); }

// Of a point fixed to the base, in its axes.
Eigen::Vector3d point_velocity(const RobotState& state, const Eigen::Vector3d& p_BF) {
  return state.X_WB.R.conjugate() * state.v_WB + state.w_WB_B.cross(p_BF);
}

// In the axes of the reference's root.
Eigen::Vector3d root_velocity(const Senses& senses) {
  return senses.reference.X_WB.R.conjugate() * senses.rates.v_WB();
}

bool is_sensed(const Channel& channel) {
  return channel.kind == ChannelKind::kBaseAngularVelocity || channel.kind == ChannelKind::kProjectedGravity;
}

// Where the gyro of a channel sits: in the frame that it names, else in the card's; -1: in the base, with its axes.
int sensor_frame(const Channel& channel, const RobotModel& robot) {
  if (!is_sensed(channel)) return -1;
  const int frame = channel.frame.empty() ? robot.roles.imu_frame : robot.frame_index(channel.frame);
  const RobotFrame& found = robot.frames[frame];
  return found.link == 0 && found.X_LF.R.isApprox(Eigen::Quaterniond::Identity(), 0.0) ? -1 : frame;
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
      action_clip_(descriptor.action_clip),
      kinematics_(*robot_),
      reference_kinematics_(*robot_) {
  for (Eigen::Index j = 0; j < neutral_.size(); ++j) neutral_[j] = descriptor.joints[j].neutral;
  size_t widest = 0, longest = 0;
  for (const ChannelGroup& group : descriptor.groups) {
    Group& made = groups_.emplace_back();
    made.values.resize(descriptor.group_size(group));
    widest = std::max(widest, made.values.size());
    for (const Channel& channel : group.channels) {
      const int frame = is_anchor(channel) ? robot_->frame_index(channel.frame) : sensor_frame(channel, *robot_);
      made.channels.push_back({channel, frame});
      anchored_ |= is_anchor(channel);
      placed_ |= frame >= 0;
    }
  }
  for (const DescriptorInput& input : descriptor.inputs) {
    Input& made = inputs_.emplace_back();
    made.values.resize(descriptor.input_size(input));
    for (const InputPart& part : input.parts) {
      const int size = descriptor.part_size(part);
      longest = std::max(longest, static_cast<size_t>(size));
      made.parts.push_back({part.groups, FrameHistory(size, part.history)});
    }
  }
  scratch_.reserve(widest);
  frame_.reserve(longest);
}

void Observer::reset() {
  for (Input& input : inputs_)
    for (Part& part : input.parts) part.history.reset();
}

void Observer::update(const Senses& senses) {
  if (placed_) kinematics_.update(senses.state.X_WB, senses.state.q);
  if (anchored_) reference_kinematics_.update(senses.reference.X_WB, senses.reference.q);
  for (Group& group : groups_) fill_group(group, senses);
  for (Input& input : inputs_) {
    std::span<float> rest = input.values;
    for (Part& part : input.parts) {
      const auto size = static_cast<size_t>(part.history.size());
      fill_part(part, rest.first(size));
      rest = rest.subspan(size);
    }
  }
}

void Observer::fill_group(Group& group, const Senses& senses) {
  size_t place = 0;
  for (const BoundChannel& bound : group.channels) {
    scratch_.clear();
    fill_channel(bound, senses, scratch_);
    const Channel& channel = bound.spec;
    for (size_t i = 0; i < scratch_.size(); ++i) {
      const double scaled = scratch_[i] * channel.scale[channel.scale.size() == 1 ? 0 : i];
      group.values[place++] = static_cast<float>(std::clamp(scaled, -channel.clip, channel.clip));
    }
  }
}

void Observer::fill_channel(const BoundChannel& bound, const Senses& senses, std::vector<double>& out) const {
  const Channel& channel = bound.spec;
  const RobotState& state = senses.state;
  const Reference& reference = senses.reference;
  switch (channel.kind) {
    case ChannelKind::kBaseLinearVelocity:
      return append(channel, point_velocity(state, channel.offset), out);
    case ChannelKind::kBaseAngularVelocity:
      return append(channel, sensor_rate(bound, state), out);
    case ChannelKind::kProjectedGravity:
      return append(channel, sensor_rotation(bound, state).conjugate() * -Eigen::Vector3d::UnitZ(), out);
    case ChannelKind::kRollPitch:
      return append(roll_pitch_of(state.X_WB.R), out);
    case ChannelKind::kCommandVelocity:
      return append(channel, {senses.command.forward, senses.command.lateral, senses.command.yaw_rate}, out);
    case ChannelKind::kCommandHeight:
      return out.push_back(senses.command.height);
    case ChannelKind::kCommandStand:
      return out.push_back(senses.gate.stands() ? 0.0 : 1.0);
    case ChannelKind::kPreviousAction: {
      const double bound = channel.clipped ? action_clip_ : std::numeric_limits<double>::infinity();
      for (const float action : senses.action) out.push_back(std::clamp<double>(action, -bound, bound));
      return;
    }
    case ChannelKind::kReferenceRootVelocity:
      return append(channel, root_velocity(senses), out);
    case ChannelKind::kReferenceHeight:
      return out.push_back(reference.X_WB.p.z());
    case ChannelKind::kReferenceRollPitch:
      return append(roll_pitch_of(reference.X_WB.R), out);
    case ChannelKind::kReferenceYawRate:
      return out.push_back(senses.rates.w_WB_B().z());
    case ChannelKind::kReferenceFrames:
      return fill_frames(channel, senses, out);
    case ChannelKind::kAnchorPositionError:
    case ChannelKind::kAnchorOrientationError:
      return fill_anchor(bound, out);
    case ChannelKind::kGaitSine:
      for (size_t i = 0; i < channel.gait.phases.size(); ++i)
        out.push_back(std::sin(gait_angle(channel.gait, i, senses.tick, senses.gate)));
      return;
    case ChannelKind::kGaitCosine:
      for (size_t i = 0; i < channel.gait.phases.size(); ++i)
        out.push_back(std::cos(gait_angle(channel.gait, i, senses.tick, senses.gate)));
      return;
    case ChannelKind::kTick:
      return out.push_back(static_cast<double>(senses.tick));
    case ChannelKind::kConstant:
      out.insert(out.end(), channel.values.begin(), channel.values.end());
      return;
    default:
      return fill_joints(channel, senses, out);
  }
}

void Observer::fill_joints(const Channel& channel, const Senses& senses, std::vector<double>& out) const {
  for (size_t k = 0; k < channel.joints.size(); ++k) {
    const int j = channel.joints[k];
    const int r = joints_[j];
    if (channel.kind == ChannelKind::kJointPosition)
      out.push_back(senses.state.q[r] - neutral_[j]);
    else if (channel.kind == ChannelKind::kJointVelocity)
      out.push_back(channel.zeroed[k] ? 0.0 : senses.state.v[r]);
    else if (channel.kind == ChannelKind::kReferenceJointPosition)
      out.push_back(senses.reference.q[r]);
    else
      out.push_back(senses.rates.qd()[r]);
  }
}

// A controller is given the reference of the present tick alone: what comes after it is taken to go on as it is (the
// same pose of the joints, the same velocities, roll, pitch and height).
void Observer::fill_frames(const Channel& channel, const Senses& senses, std::vector<double>& out) const {
  for (size_t step = 0; step < channel.steps.size(); ++step) {
    out.push_back(senses.reference.X_WB.p.z());
    append(roll_pitch_of(senses.reference.X_WB.R), out);
    append(root_velocity(senses), out);
    out.push_back(senses.rates.w_WB_B().z());
    for (const int j : channel.joints) out.push_back(senses.reference.q[joints_[j]]);
  }
}

void Observer::fill_anchor(const BoundChannel& bound, std::vector<double>& out) const {
  const Pose error = kinematics_.frame_pose(bound.frame).inverse() * reference_kinematics_.frame_pose(bound.frame);
  if (bound.spec.kind == ChannelKind::kAnchorPositionError) return append(error.p, out);
  const Eigen::Matrix3d R = error.R.toRotationMatrix();
  for (int row = 0; row < 3; ++row) out.insert(out.end(), {R(row, 0), R(row, 1)});
}

Eigen::Quaterniond Observer::sensor_rotation(const BoundChannel& bound, const RobotState& state) const {
  return bound.frame < 0 ? state.X_WB.R : kinematics_.frame_pose(bound.frame).R;
}

// The base's rate and those of the hinges between it and the frame.
Eigen::Vector3d Observer::sensor_rate(const BoundChannel& bound, const RobotState& state) const {
  if (bound.frame < 0) return state.w_WB_B;
  Eigen::Vector3d w_WF = state.X_WB.R * state.w_WB_B;
  for (int link = robot_->frames[bound.frame].link; link > 0; link = robot_->links[link].parent)
    w_WF += state.v[link - 1] * (kinematics_.R_WL(link) * robot_->links[link].axis);
  return kinematics_.frame_pose(bound.frame).R.conjugate() * w_WF;
}

void Observer::fill_part(Part& part, std::span<float> out) {
  frame_.clear();
  for (const int group : part.groups)
    frame_.insert(frame_.end(), groups_[group].values.begin(), groups_[group].values.end());
  part.history.add(frame_, out);
}

}  // namespace duet
