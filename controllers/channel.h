// One channel of a controller's observation: what it shows and how it is scaled. Plain data; the names are those of an
// IO descriptor (docs/file-formats.md, "IO descriptor").
#pragma once

#include <Eigen/Core>
#include <limits>
#include <string>
#include <string_view>
#include <vector>

#include "duet/io/gait_clock.h"

namespace duet {

enum class ChannelKind {
  kBaseLinearVelocity,      // 3: of a point of the base, in its axes [m/s]
  kBaseAngularVelocity,     // 3: a gyro's reading [rad/s]
  kProjectedGravity,        // 3: direction of gravity in the axes of the base, or of the frame where the gyro sits
  kRollPitch,               // 2 [rad]
  kCommandVelocity,         // 3: forward, lateral, yaw rate [m/s, m/s, rad/s]
  kCommandHeight,           // 1 [m]
  kCommandStand,            // 1: 1 walks, 0 stands (VelocityInterface::stands_below)
  kJointPosition,           // from the default pose [rad]
  kJointVelocity,           // [rad/s]
  kPreviousAction,          // the network's last output; zeros at the start
  kReferenceRootVelocity,   // 3: in the axes of the reference's root [m/s]
  kReferenceHeight,         // 1 [m]
  kReferenceRollPitch,      // 2 [rad]
  kReferenceYawRate,        // 1: about the z axis of the reference's root [rad/s]
  kReferenceJointPosition,  // [rad]
  kReferenceJointVelocity,  // [rad/s]
  kReferenceFrames,         // per future step: height, roll, pitch, root velocity, yaw rate, joints
  kAnchorPositionError,     // 3: of the reference's anchor in the axes of the robot's [m]
  kAnchorOrientationError,  // 6: first two columns of that rotation, row by row
  kGaitSine,                // one per phase
  kGaitCosine,              // one per phase
  kTick,                    // 1: ticks since the start
  kConstant,                // the given values
};

struct Channel {
  ChannelKind kind = ChannelKind::kConstant;
  int line = 0;                                           // in the descriptor's file
  std::vector<double> scale = {1.0};                      // one for all or one each
  double clip = std::numeric_limits<double>::infinity();  // bound of the scaled value's size
  std::vector<int> joints;                                // of the descriptor's list, in the channel's order
  std::vector<bool> zeroed;                               // per entry of `joints`: shown as 0
  std::vector<int> axes;                                  // components of a vector that are shown
  Eigen::Vector3d offset = Eigen::Vector3d::Zero();       // p_BF of the point whose velocity is shown [m]
  bool clipped = false;                                   // previous_action: after the action's clip
  std::string frame;                                      // of the robot: the anchor; of a gyro: "" is the base
  GaitClock gait;                                         // of a clock
  std::vector<int> steps;                                 // ticks ahead of the reference's frames, >= 1
  std::vector<double> values;                             // of a constant
};

const char* to_string(ChannelKind kind);
std::vector<std::string> channel_names();
// Throws std::invalid_argument with the nearest and all known names.
ChannelKind channel_kind(std::string_view name);
// Whether the key of a channel (beside `channel`, `scale` and `clip`) belongs to its kind.
bool takes_key(ChannelKind kind, std::string_view key);
// Numbers that it shows; `actions`: of the network's output.
int channel_size(const Channel& channel, int actions);

}  // namespace duet
