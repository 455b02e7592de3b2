// The channels of one frame, which show partner and robot: the same numbers for D-STAR, networks of others and programs
// of others.
#pragma once

#include <span>
#include <vector>

#include "duet/io/observation.h"
#include "duet/policies/policy.h"

namespace duet {

// The frame that positions and orientations of an observation refer to.
enum class PolicyFrame {
  kWorld,  // W; the robot's root since the episode's start
  kEgo,    // E: on the ground below the robot's root as it is now, x along its heading; joints of the partner from its
           // root, in E's axes
};

// The frame of supplement A.2.1: partner's root (3) and joints (72), velocities of the base (3 + 3), gravity (3), joint
// angles and velocities (n each), root (3), its orientation (4): 149 numbers for 29 joints. `angles`: kJointAngle, or
// kJointPosition from the neutral pose.
std::vector<Channel> frame_channels(ChannelKind angles = ChannelKind::kJointAngle);

// One frame as its channels show it; borrowed. Made once for all of them.
class FrameSenses {
 public:
  // `joints`: the robot's, in the order in which they are shown; none: in the robot's order. `origin`: with kWorld the
  // root's place at the episode's start. `X_WE`: with kEgo, of now.
  static FrameSenses in_world(const ObservationFrame& frame, const RobotModel& robot, std::span<const int> joints,
                              const Eigen::Vector3d& origin);
  static FrameSenses in_ego(const ObservationFrame& frame, const RobotModel& robot, std::span<const int> joints,
                            const Pose& X_EW);

  // Writes a channel of a kind that frame_channels may have; std::logic_error for another.
  void show(ChannelKind kind, ChannelWriter& out) const;

 private:
  FrameSenses(const ObservationFrame& frame, const RobotModel& robot, std::span<const int> joints, PolicyFrame refers);
  void show_partner(ChannelWriter& out) const;
  void show_joints(ChannelKind kind, ChannelWriter& out) const;

  const ObservationFrame* frame_;
  const RobotModel* robot_;
  std::span<const int> joints_;
  PolicyFrame refers_;
  Eigen::Matrix3d R_BW_;
  Pose X_FW_;  // of W in the frame that positions refer to
  Eigen::Vector3d origin_ = Eigen::Vector3d::Zero();
};

// The numbers of all of them one after another: `out` has channels_size.
void write_frame(std::span<const Channel> channels, const FrameSenses& senses, std::span<float> out);

// Whether it differs between the frames of a history.
bool is_of_a_frame(ChannelKind kind);

}  // namespace duet
