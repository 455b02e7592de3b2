#include "duet/policies/frame_channels.h"

namespace duet {

std::vector<Channel> frame_channels(ChannelKind angles) {
  std::vector<Channel> channels;
  for (const ChannelKind kind :
       {ChannelKind::kPartnerRoot, ChannelKind::kPartnerJoints, ChannelKind::kBaseLinearVelocity,
        ChannelKind::kBaseAngularVelocity, ChannelKind::kGravity, angles, ChannelKind::kJointVelocity,
        ChannelKind::kRootOffset, ChannelKind::kRootOrientation})
    channels.push_back({.kind = kind});
  return channels;
}

FrameSenses::FrameSenses(const ObservationFrame& frame, const RobotModel& robot, std::span<const int> joints,
                         PolicyFrame refers)
    : frame_(&frame),
      robot_(&robot),
      joints_(joints),
      refers_(refers),
      R_BW_(frame.robot.X_WB.R.conjugate().toRotationMatrix()) {}

FrameSenses FrameSenses::in_world(const ObservationFrame& frame, const RobotModel& robot, std::span<const int> joints,
                                  const Eigen::Vector3d& origin) {
  FrameSenses senses(frame, robot, joints, PolicyFrame::kWorld);
  senses.origin_ = origin;
  return senses;
}

FrameSenses FrameSenses::in_ego(const ObservationFrame& frame, const RobotModel& robot, std::span<const int> joints,
                                const Pose& X_EW) {
  FrameSenses senses(frame, robot, joints, PolicyFrame::kEgo);
  senses.X_FW_ = X_EW;
  return senses;
}

void FrameSenses::show(ChannelKind kind, ChannelWriter& out) const {
  const RobotState& robot = frame_->robot;
  const bool ego = refers_ == PolicyFrame::kEgo;
  switch (kind) {
    case ChannelKind::kPartnerRoot:
      return out(X_FW_ * Eigen::Vector3d(frame_->partner.col(0)));
    case ChannelKind::kPartnerJoints:
      return show_partner(out);
    case ChannelKind::kBaseLinearVelocity:
      return out(Eigen::Vector3d(R_BW_ * robot.v_WB));
    case ChannelKind::kBaseAngularVelocity:
      return out(robot.w_WB_B);
    case ChannelKind::kGravity:
      return out(-R_BW_.col(2));
    case ChannelKind::kRootOffset:
      return out(Eigen::Vector3d(ego ? X_FW_ * robot.X_WB.p : robot.X_WB.p - origin_));
    case ChannelKind::kRootOrientation:
      return out(wxyz_of(X_FW_.R * robot.X_WB.R));
    default:
      return show_joints(kind, out);
  }
}

void FrameSenses::show_partner(ChannelWriter& out) const {
  if (refers_ == PolicyFrame::kWorld) return out(frame_->partner.reshaped());
  const Eigen::Matrix3d R_EW = X_FW_.R.toRotationMatrix();
  const Eigen::Matrix<double, 3, kSmplJoints> joints = R_EW * (frame_->partner.colwise() - frame_->partner.col(0));
  out(joints.reshaped());
}

void FrameSenses::show_joints(ChannelKind kind, ChannelWriter& out) const {
  const bool angles = kind == ChannelKind::kJointAngle || kind == ChannelKind::kJointPosition;
  if (!angles && kind != ChannelKind::kJointVelocity) throw std::logic_error("a channel that is not of a frame");
  const Eigen::VectorXd& values = angles ? frame_->robot.q : frame_->robot.v;
  for (Eigen::Index i = 0; i < values.size(); ++i) {
    const Eigen::Index joint = joints_.empty() ? i : joints_[static_cast<std::size_t>(i)];
    out(kind == ChannelKind::kJointPosition ? values[joint] - robot_->neutral[joint] : values[joint]);
  }
}

void write_frame(std::span<const Channel> channels, const FrameSenses& senses, std::span<float> out) {
  write_channels(
      channels, [&](const Channel& channel, ChannelWriter& writer) { senses.show(channel.kind, writer); }, out);
}

bool is_of_a_frame(ChannelKind kind) {
  return kind != ChannelKind::kLanguage && kind != ChannelKind::kTask && kind != ChannelKind::kTime &&
         kind != ChannelKind::kNoise;
}

}  // namespace duet
