#include "duet/io/channel.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <iterator>
#include <numbers>
#include <sstream>
#include <stdexcept>

#include "duet/core/names.h"
#include "duet/core/robot_state.h"

namespace duet {
namespace {

using K = ChannelKind;

const char* name_in(const ChannelRow& row, ChannelFormat format) {
  switch (format) {
    case ChannelFormat::kController:
      return row.controller;
    case ChannelFormat::kPolicy:
      return row.policy;
    case ChannelFormat::kNetwork:
      return row.network;
  }
  return "";
}

const ChannelRow& row(ChannelKind kind) { return channel_table()[static_cast<std::size_t>(kind)]; }

// Height, roll, pitch, three velocities, yaw rate: what a frame of the reference has beside its joints.
constexpr int kFrameHead = 7;

}  // namespace

const std::vector<ChannelRow>& channel_table() {
  static const std::vector<ChannelRow> table = {
      {K::kPartnerRoot, "", "partner_root", "partner_root", "", 3, "3 [m]", "the partner's root"},
      {K::kPartnerJoints, "", "partner_joints", "partner_joint", "", 72, "72 [m]",
       "the partner's SMPL-24 joints, x, y, z each; with `frame_of_reference: ego` from the partner's root"},
      {K::kBaseLinearVelocity, "base_linear_velocity", "base_linear_velocity", "base_linear_velocity", " offset axes ",
       3, "3 [m/s]", "velocity of a point of the base (`offset` [m], default its origin), in the axes of the base"},
      {K::kBaseAngularVelocity, "base_angular_velocity", "base_angular_velocity", "base_angular_velocity",
       " axes frame ", 3, "3 [rad/s]",
       "the gyro's; `frame`: of the robot, in which it sits (default: the card's `imu`)"},
      {K::kGravity, "projected_gravity", "gravity", "gravity", " axes frame ", 3, "3",
       "direction of gravity in the axes of the base, or of that frame"},
      {K::kRollPitch, "roll_pitch", "", "", "", 2, "2 [rad]", "of the base"},
      {K::kRollPitchYaw, "roll_pitch_yaw", "", "", " axes ", 3, "3 [rad]",
       "of the base: turns about the fixed axes x, y, z of W; the yaw is the world's, in (-pi, pi]"},
      {K::kCommandVelocity, "command_velocity", "", "", " axes ", 3, "3 [m/s, m/s, rad/s]",
       "forward, lateral, yaw rate; `axes`: which of them, in which order: `[2]`, `[0, 1]`"},
      {K::kCommandHeight, "command_height", "", "", "", 1, "1 [m]", "the commanded height of the pelvis"},
      {K::kCommandStand, "command_stand", "", "", "", 1, "1", "1 walks, 0 stands; needs `stands_below` of `command`"},
      {K::kJointAngle, "", "joint_positions", "", "", 0, "one per joint [rad]", "joint angles"},
      {K::kJointPosition, "joint_position", "joint_offsets", "joint_position", " joints zero ", 0,
       "one per joint [rad]",
       "joint angles from the default pose, of a policy from the card's neutral pose; `zero`: joints that are shown "
       "as 0"},
      {K::kJointVelocity, "joint_velocity", "joint_velocities", "joint_velocity", " joints zero ", 0,
       "one per joint [rad/s]", "`zero`: joints that are shown as 0"},
      {K::kRootOffset, "", "root_offset", "root_translation", "", 3, "3 [m]",
       "the root from where it was at the start, in the axes of W; with `ego` its place in E"},
      {K::kRootOrientation, "", "root_orientation", "root_orientation", "", 4, "4",
       "quaternion wxyz, w >= 0, in W; with `ego` in E"},
      {K::kPreviousAction, "previous_action", "", "previous_action", " clipped ", 0, "one per action",
       "the network's last output, zeros at the start; `clipped: true`: after `clip` of `action` and of the joints"},
      {K::kReferenceRootVelocity, "reference_root_velocity", "", "", " axes ", 3, "3 [m/s]",
       "in the axes of the reference's root"},
      {K::kReferenceHeight, "reference_height", "", "", "", 1, "1 [m]", "of the reference's root"},
      {K::kReferenceRollPitch, "reference_roll_pitch", "", "", "", 2, "2 [rad]", "of the reference's root"},
      {K::kReferenceYawRate, "reference_yaw_rate", "", "", "", 1, "1 [rad/s]", "about the z axis of its root"},
      {K::kReferenceJointAngle, "reference_joint_position", "", "", " joints ", 0, "one per joint [rad]",
       "the reference's joint angles"},
      {K::kReferenceJointPosition, "", "", "reference_joint_position", "", 0, "one per joint [rad]",
       "the reference's joint angles from the neutral pose"},
      {K::kReferenceJointVelocity, "reference_joint_velocity", "", "reference_joint_velocity", " joints ", 0,
       "one per joint [rad/s]", "the reference's joint velocities"},
      {K::kReferenceFrames, "reference_frames", "", "", " joints steps ", 0, "7 and the joints, per step",
       "height, roll, pitch, root velocity, yaw rate, joint angles of the reference, `steps` ahead [ticks]"},
      {K::kRootPositionError, "", "", "root_position_error", "", 3, "3 [m]",
       "of the reference's root from the base, in the axes of the base, at most 1 m long"},
      {K::kRootOrientationError, "", "", "root_orientation_error", "", 6, "6",
       "first two columns of that rotation, one after the other"},
      {K::kAnchorPositionError, "anchor_position_error", "", "", " frame ", 3, "3 [m]",
       "of the reference's `frame` in the robot's"},
      {K::kAnchorOrientationError, "anchor_orientation_error", "", "", " frame ", 6, "6",
       "first two columns of its rotation, row by row"},
      {K::kGaitSine, "gait_sine", "", "", " frequency_hz phases standing after_standing stance ", 0, "one per phase",
       "of a clock with `frequency_hz`. `phases`: at the start (default 0) [rad]; `standing`: phases held while told "
       "to stand, one each, or `zero`: sine and cosine are both 0 then (without it the clock goes on; needs "
       "`stands_below`); `after_standing`: the clock `restarts` at `phases` (default), is where it would be had it "
       "not been held (`runs_on`), or goes on where it was held (`pauses`); `stance`: share of a turn, in (0, 1), "
       "that takes the first half of the wave, the rest the second (piecewise linear, of held phases too)"},
      {K::kGaitCosine, "gait_cosine", "", "", " frequency_hz phases standing after_standing stance ", 0,
       "one per phase", "the same clock's cosine"},
      {K::kTick, "tick", "", "", "", 1, "1", "ticks since the start"},
      {K::kConstant, "constant", "", "", " values ", 0, "as given", "the numbers of `values`"},
      {K::kLanguage, "", "language", "", "", kPromptNumbers, "768",
       "embedding of the episode's prompt: the built-in encoder, or the option `language` (a table)"},
      {K::kTask, "", "task", "", "", 0, "6, or as many as the descriptor's `tasks`",
       "1 for the episode's task, else 0, in the order of `tasks`"},
      {K::kTime, "", "time", "", "", 1, "1 [s]", "since the episode's start"},
      {K::kNoise, "", "noise", "", "", 0, "`size`",
       "standard normal numbers from the episode's seed, new at each call: a diffusion head's start"},
  };
  return table;
}

std::string channel_name(ChannelKind kind, ChannelFormat format) { return name_in(row(kind), format); }

std::vector<std::string> channel_names(ChannelFormat format) {
  std::vector<std::string> names;
  for (const ChannelRow& each : channel_table())
    if (*name_in(each, format) != '\0') names.emplace_back(name_in(each, format));
  return names;
}

ChannelKind channel_kind(std::string_view name, ChannelFormat format) {
  for (const ChannelRow& each : channel_table())
    if (!name.empty() && name == name_in(each, format)) return each.kind;
  throw std::invalid_argument(unknown_name_message("channel", name, channel_names(format)));
}

std::vector<std::string> channel_keys(ChannelKind kind) {
  std::istringstream words{std::string(row(kind).keys)};
  return {std::istream_iterator<std::string>(words), std::istream_iterator<std::string>()};
}

bool takes_key(ChannelKind kind, std::string_view key) {
  return row(kind).keys.find(fmt::format(" {} ", key)) != std::string_view::npos;
}

int channel_size(const Channel& channel, const ChannelWidths& widths) {
  if (!channel.axes.empty()) return static_cast<int>(channel.axes.size());
  if (row(channel.kind).size > 0) return row(channel.kind).size;
  const int joints = static_cast<int>(channel.joints.size());
  switch (channel.kind) {
    case ChannelKind::kPreviousAction:
      return widths.actions;
    case ChannelKind::kReferenceFrames:
      return static_cast<int>(channel.steps.size()) * (kFrameHead + joints);
    case ChannelKind::kGaitSine:
    case ChannelKind::kGaitCosine:
      return static_cast<int>(channel.gait.phases.size());
    case ChannelKind::kConstant:
      return static_cast<int>(channel.values.size());
    case ChannelKind::kTask:
    case ChannelKind::kNoise:
      return channel.size;
    default:
      return joints == 0 ? widths.joints : joints;
  }
}

namespace {

constexpr double kTurn = 2.0 * std::numbers::pi;

// Piecewise linear: the first share of a turn takes half of it, the rest the other half.
double warped_angle(double angle, double stance) {
  const double turns = angle / kTurn, place = turns - std::floor(turns);
  return kTurn * (place < stance ? 0.5 * place / stance : 0.5 + 0.5 * (place - stance) / (1.0 - stance));
}

// Ticks that the clock has gone.
long clock_ticks(const GaitClock& clock, long tick, const StandGate& gate) {
  if (clock.standing.empty() || clock.after_standing == AfterStanding::kRunsOn) return tick;
  return clock.after_standing == AfterStanding::kPauses ? gate.walked_ticks() : gate.walking_tick();
}

double plain_angle(const GaitClock& clock, std::size_t phase, long tick, const StandGate& gate, double period) {
  if (!clock.standing.empty() && gate.stands()) return clock.standing[phase];
  const double turns = clock.frequency_hz * period * static_cast<double>(clock_ticks(clock, tick, gate));
  return kTurn * (turns - std::floor(turns)) + clock.phases[phase];
}

}  // namespace

void StandGate::update(double forward, double lateral, double yaw_rate) {
  stands_ = bounds_ && std::hypot(forward, lateral) < bounds_->speed && std::abs(yaw_rate) < bounds_->yaw_rate;
  walked_ticks_ += walking_tick_ >= 0 ? 1 : 0;
  walking_tick_ = stands_ ? -1 : walking_tick_ + 1;
}

double gait_angle(const GaitClock& clock, std::size_t phase, long tick, const StandGate& gate, double period) {
  const double angle = plain_angle(clock, phase, tick, gate, period);
  return clock.stance ? warped_angle(angle, *clock.stance) : angle;
}

JointBinding bind_by_name(std::span<const std::string> names, const RobotModel& robot) {
  const std::vector<std::string> known = robot.joint_names();
  JointBinding binding;
  for (const std::string& name : names) {
    const auto it = std::ranges::find(known, name);
    binding.indices.push_back(it == known.end() ? -1 : static_cast<int>(it - known.begin()));
    if (it == known.end()) binding.absent.push_back(name);
  }
  for (const std::string& name : known)
    if (std::ranges::find(names, name) == names.end()) binding.unnamed.push_back(name);
  return binding;
}

}  // namespace duet
