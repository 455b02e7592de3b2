#include "duet/policies/external/channel_values.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "duet/core/clock.h"
#include "duet/core/names.h"
#include "duet/core/require.h"
#include "duet/io/joint_binding.h"
#include "duet/policies/dstar/features.h"

namespace duet {
namespace {

void put(const Eigen::Vector3d& vector, std::span<float> out) {
  Eigen::Map<Eigen::Vector3f>(out.data()) = vector.cast<float>();
}

void put(const Eigen::Quaterniond& rotation, std::span<float> out) {
  Eigen::Map<Eigen::Vector4f>(out.data()) = wxyz_of(rotation).cast<float>();
}

double at(const std::vector<double>& values, std::size_t i) { return values.size() == 1 ? values[0] : values[i]; }

}  // namespace

std::vector<int> bind_joints(const PolicyDescriptor& descriptor, const RobotModel& robot) {
  const std::vector<std::string> known = robot.joint_names();
  const std::vector<std::string>& names = descriptor.joints.empty() ? known : descriptor.joints;
  const auto refuse = [&](const std::string& message) {
    throw InputError(fmt::format("{}:{}: 'joints' with robot '{}': {}", descriptor.file, descriptor.joints_line,
                                 robot.name, message));
  };
  JointBinding bound = bind_by_name(names, robot);
  if (!bound.absent.empty()) refuse(unknown_name_message("joint", bound.absent[0], known));
  if (!bound.unnamed.empty())
    refuse(fmt::format("expected its {} joints, found none '{}'", known.size(), bound.unnamed[0]));
  return std::move(bound.indices);
}

std::vector<PolicyChannel> frame_channels() {
  std::vector<PolicyChannel> channels;
  for (const PolicyChannelKind kind :
       {PolicyChannelKind::kPartnerRoot, PolicyChannelKind::kPartnerJoints, PolicyChannelKind::kBaseLinearVelocity,
        PolicyChannelKind::kBaseAngularVelocity, PolicyChannelKind::kGravity, PolicyChannelKind::kJointPositions,
        PolicyChannelKind::kJointVelocities, PolicyChannelKind::kRootOffset, PolicyChannelKind::kRootOrientation})
    channels.push_back({.kind = kind});
  return channels;
}

ChannelValues::ChannelValues(std::shared_ptr<const RobotModel> robot, std::vector<int> joints,
                             const PolicyDescriptor& descriptor)
    : robot_(std::move(robot)), joints_(std::move(joints)), frame_(descriptor.frame), tasks_(descriptor.tasks) {}

void ChannelValues::reset(const EpisodeContext& context, std::vector<float> language) {
  start_ = context.start.X_WB.p;
  task_ = context.task;
  language_ = std::move(language);
  noise_ = Random(context.seed, stream_key({"policy", "noise"}));
}

void ChannelValues::write(const PolicyChannel& channel, const Observation& observation, int frame,
                          std::span<float> out) {
  write_plain(channel.kind, observation, frame, out);
  for (std::size_t i = 0; i < out.size(); ++i)
    out[i] = static_cast<float>((out[i] - at(channel.offset, i)) * at(channel.scale, i));
}

void ChannelValues::write_plain(PolicyChannelKind kind, const Observation& observation, int frame,
                                std::span<float> out) {
  switch (kind) {
    case PolicyChannelKind::kLanguage:
      std::ranges::copy(language_, out.begin());
      return;
    case PolicyChannelKind::kTask:
      std::ranges::transform(tasks_, out.begin(), [this](Task task) { return task == task_ ? 1.0F : 0.0F; });
      return;
    case PolicyChannelKind::kTime:
      out[0] = static_cast<float>(observation.tick * kTick);
      return;
    case PolicyChannelKind::kNoise:
      for (float& number : out) number = static_cast<float>(noise_.normal());
      return;
    default:
      write_of_frame(kind, observation.history[static_cast<std::size_t>(frame)],
                     frame_ == PolicyFrame::kEgo ? ego_frame(observation.now().robot).inverse() : Pose{}, out);
  }
}

// X_FW: of W in the frame that positions refer to.
void ChannelValues::write_of_frame(PolicyChannelKind kind, const ObservationFrame& frame, const Pose& X_FW,
                                   std::span<float> out) {
  const RobotState& robot = frame.robot;
  const bool ego = frame_ == PolicyFrame::kEgo;
  switch (kind) {
    case PolicyChannelKind::kPartnerRoot:
      put(X_FW * Eigen::Vector3d(frame.partner.col(0)), out);
      return;
    case PolicyChannelKind::kPartnerJoints:
      for (int j = 0; j < 24; ++j) {
        const Eigen::Vector3d joint = frame.partner.col(j);
        put(ego ? X_FW.R * (joint - frame.partner.col(0)) : joint, out.subspan(3 * j));
      }
      return;
    case PolicyChannelKind::kBaseLinearVelocity:
      put(robot.X_WB.R.conjugate() * robot.v_WB, out);
      return;
    case PolicyChannelKind::kBaseAngularVelocity:
      put(robot.w_WB_B, out);
      return;
    case PolicyChannelKind::kGravity:
      put(robot.X_WB.R.conjugate() * -Eigen::Vector3d::UnitZ(), out);
      return;
    case PolicyChannelKind::kRootOffset:
      put(ego ? X_FW * robot.X_WB.p : robot.X_WB.p - start_, out);
      return;
    case PolicyChannelKind::kRootOrientation:
      put(X_FW.R * robot.X_WB.R, out);
      return;
    default:
      write_of_joints(kind, robot, out);
  }
}

void ChannelValues::write_of_joints(PolicyChannelKind kind, const RobotState& robot, std::span<float> out) const {
  const Eigen::VectorXd& values = kind == PolicyChannelKind::kJointVelocities ? robot.v : robot.q;
  for (std::size_t i = 0; i < joints_.size(); ++i) {
    const double zero = kind == PolicyChannelKind::kJointOffsets ? robot_->neutral[joints_[i]] : 0.0;
    out[i] = static_cast<float>(values[joints_[i]] - zero);
  }
}

}  // namespace duet
