// Why a command was changed before it went out. Each is counted, each is in the log.
#pragma once

#include <array>
#include <cstddef>
#include <string_view>

namespace duet {

enum class ClampReason {
  kNotFinite,       // the whole command was refused: a number that is not finite
  kSize,            // the whole command was refused: not one target for each joint
  kStamp,           // the whole command was refused: not newer than the one before
  kHold,            // the state machine allows less than full speed
  kNoOdometry,      // nobody measures where the root is
  kFence,           // out of the box
  kSeparation,      // too near a person for this speed
  kPartnerUnknown,  // nobody says where the person is
  kHeadDistance,    // towards head or neck of a person
  kTouchSpeed,      // faster than a touch of this region may be
  kRelease,         // the arms open
  kRootSpeed,
  kRootAcceleration,
  kRootJerk,
  kHeight,
  kJointLimit,
  kJointSpeed,
  kJointAcceleration,
  kJointLead,    // too far ahead of the measured angle
  kJointTorque,  // gains lowered, because the target may not go back fast enough
  kSelfCollision,
};
inline constexpr std::size_t kClampReasons = 21;

using ClampCounts = std::array<long, kClampReasons>;

inline constexpr std::array<std::string_view, kClampReasons> kClampNames = {"not_finite",
                                                                            "size",
                                                                            "stamp",
                                                                            "hold",
                                                                            "no_odometry",
                                                                            "fence",
                                                                            "separation",
                                                                            "partner_unknown",
                                                                            "head_distance",
                                                                            "touch_speed",
                                                                            "release",
                                                                            "root_speed",
                                                                            "root_acceleration",
                                                                            "root_jerk",
                                                                            "height",
                                                                            "joint_limit",
                                                                            "joint_speed",
                                                                            "joint_acceleration",
                                                                            "joint_lead",
                                                                            "joint_torque",
                                                                            "self_collision"};

inline void count(ClampCounts& counts, ClampReason reason) { ++counts[static_cast<std::size_t>(reason)]; }
inline long counted(const ClampCounts& counts, ClampReason reason) { return counts[static_cast<std::size_t>(reason)]; }

}  // namespace duet
