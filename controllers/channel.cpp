#include "duet/controllers/channel.h"

#include <fmt/format.h>

#include "duet/core/names.h"
#include "duet/core/require.h"

namespace duet {
namespace {

struct Row {
  ChannelKind kind;
  const char* name;
  std::string_view keys;  // those it takes, each between spaces
  int size;               // 0: depends on what is given
};

// In the order of ChannelKind.
constexpr Row kRows[] = {
    {ChannelKind::kBaseLinearVelocity, "base_linear_velocity", " offset axes ", 3},
    {ChannelKind::kBaseAngularVelocity, "base_angular_velocity", " axes frame ", 3},
    {ChannelKind::kProjectedGravity, "projected_gravity", " axes frame ", 3},
    {ChannelKind::kRollPitch, "roll_pitch", "", 2},
    {ChannelKind::kCommandVelocity, "command_velocity", " axes ", 3},
    {ChannelKind::kCommandHeight, "command_height", "", 1},
    {ChannelKind::kCommandStand, "command_stand", "", 1},
    {ChannelKind::kJointPosition, "joint_position", " joints ", 0},
    {ChannelKind::kJointVelocity, "joint_velocity", " joints zero ", 0},
    {ChannelKind::kPreviousAction, "previous_action", " clipped ", 0},
    {ChannelKind::kReferenceRootVelocity, "reference_root_velocity", " axes ", 3},
    {ChannelKind::kReferenceHeight, "reference_height", "", 1},
    {ChannelKind::kReferenceRollPitch, "reference_roll_pitch", "", 2},
    {ChannelKind::kReferenceYawRate, "reference_yaw_rate", "", 1},
    {ChannelKind::kReferenceJointPosition, "reference_joint_position", " joints ", 0},
    {ChannelKind::kReferenceJointVelocity, "reference_joint_velocity", " joints ", 0},
    {ChannelKind::kReferenceFrames, "reference_frames", " joints steps ", 0},
    {ChannelKind::kAnchorPositionError, "anchor_position_error", " frame ", 3},
    {ChannelKind::kAnchorOrientationError, "anchor_orientation_error", " frame ", 6},
    {ChannelKind::kGaitSine, "gait_sine", " frequency_hz phases standing stance ", 0},
    {ChannelKind::kGaitCosine, "gait_cosine", " frequency_hz phases standing stance ", 0},
    {ChannelKind::kTick, "tick", "", 1},
    {ChannelKind::kConstant, "constant", " values ", 0},
};

const Row& row(ChannelKind kind) { return kRows[static_cast<int>(kind)]; }

// Height, roll, pitch, three velocities, yaw rate: what a frame of the reference has beside its joints.
constexpr int kFrameHead = 7;

}  // namespace

const char* to_string(ChannelKind kind) { return row(kind).name; }

std::vector<std::string> channel_names() {
  std::vector<std::string> names;
  for (const Row& each : kRows) names.emplace_back(each.name);
  return names;
}

ChannelKind channel_kind(std::string_view name) {
  for (const Row& each : kRows)
    if (name == each.name) return each.kind;
  throw std::invalid_argument(unknown_name_message("channel", name, channel_names()));
}

bool takes_key(ChannelKind kind, std::string_view key) {
  return row(kind).keys.find(fmt::format(" {} ", key)) != std::string_view::npos;
}

int channel_size(const Channel& channel, int actions) {
  if (!channel.axes.empty()) return static_cast<int>(channel.axes.size());
  if (row(channel.kind).size > 0) return row(channel.kind).size;
  const int joints = static_cast<int>(channel.joints.size());
  switch (channel.kind) {
    case ChannelKind::kPreviousAction:
      return actions;
    case ChannelKind::kReferenceFrames:
      return static_cast<int>(channel.steps.size()) * (kFrameHead + joints);
    case ChannelKind::kGaitSine:
    case ChannelKind::kGaitCosine:
      return static_cast<int>(channel.gait.phases.size());
    case ChannelKind::kConstant:
      return static_cast<int>(channel.values.size());
    default:
      return joints;
  }
}

}  // namespace duet
