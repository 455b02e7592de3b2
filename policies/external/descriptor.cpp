#include "duet/policies/external/descriptor.h"

#include <filesystem>

#include "duet/core/file.h"
#include "duet/core/task.h"
#include "duet/policies/language.h"

namespace duet {

std::string PolicyDescriptor::folder() const {
  const std::string parent = std::filesystem::path(file).parent_path().string();
  return parent.empty() ? "." : parent;
}

std::string_view to_string(PolicyChannelKind kind) {
  switch (kind) {
    case PolicyChannelKind::kPartnerRoot:
      return "partner_root";
    case PolicyChannelKind::kPartnerJoints:
      return "partner_joints";
    case PolicyChannelKind::kBaseLinearVelocity:
      return "base_linear_velocity";
    case PolicyChannelKind::kBaseAngularVelocity:
      return "base_angular_velocity";
    case PolicyChannelKind::kGravity:
      return "gravity";
    case PolicyChannelKind::kJointPositions:
      return "joint_positions";
    case PolicyChannelKind::kJointOffsets:
      return "joint_offsets";
    case PolicyChannelKind::kJointVelocities:
      return "joint_velocities";
    case PolicyChannelKind::kRootOffset:
      return "root_offset";
    case PolicyChannelKind::kRootOrientation:
      return "root_orientation";
    case PolicyChannelKind::kLanguage:
      return "language";
    case PolicyChannelKind::kTask:
      return "task";
    case PolicyChannelKind::kTime:
      return "time";
    case PolicyChannelKind::kNoise:
      return "noise";
  }
  return "";
}

std::string_view to_string(PolicyFrame frame) { return frame == PolicyFrame::kWorld ? "world" : "ego"; }

std::string_view to_string(PlanFrame frame) {
  switch (frame) {
    case PlanFrame::kWorld:
      return "world";
    case PlanFrame::kEgo:
      return "ego";
    case PlanFrame::kDisplacement:
      return "displacement";
  }
  return "";
}

int channel_size(const PolicyChannel& channel, int joints) {
  switch (channel.kind) {
    case PolicyChannelKind::kPartnerJoints:
      return 72;
    case PolicyChannelKind::kJointPositions:
    case PolicyChannelKind::kJointOffsets:
    case PolicyChannelKind::kJointVelocities:
      return joints;
    case PolicyChannelKind::kRootOrientation:
      return 4;
    case PolicyChannelKind::kLanguage:
      return kLanguageSize;
    case PolicyChannelKind::kTime:
      return 1;
    case PolicyChannelKind::kTask:
    case PolicyChannelKind::kNoise:
      return channel.size;
    default:
      return 3;
  }
}

bool is_of_a_frame(PolicyChannelKind kind) { return kind < PolicyChannelKind::kLanguage; }

PolicyDescriptor read_policy_descriptor(const std::string& path) {
  return parse_policy_descriptor(read_text(path), path);
}

}  // namespace duet
