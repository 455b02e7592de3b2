// Slips of adapters, as changes of descriptors that are known to be right.
#pragma once

#include <algorithm>
#include <array>
#include <functional>
#include <numbers>
#include <string>
#include <vector>

#include "duet/controllers/audit/readings.h"
#include "duet/robots/robot_model.h"

namespace duet::test {

struct InjectedDefect {
  const char* name;
  const char* controller;                                      // by whose descriptor it is tried in the first place
  ContractPart part;                                           // what the audit has to name
  std::function<bool(Descriptor&, const RobotModel&)> inject;  // false: the descriptor has no such part
};

inline bool change_channels(Descriptor& descriptor, ChannelKind kind, const std::function<void(Channel&)>& change) {
  bool changed = false;
  for (ChannelGroup& group : descriptor.observation.groups)
    for (Channel& channel : group.channels)
      if (channel.kind == kind) {
        change(channel);
        changed = true;
      }
  return changed;
}

inline void spread(Channel& channel, const Descriptor& descriptor) {
  if (channel.scale.size() == 1) channel.scale.assign(channel_size(channel, descriptor.widths()), channel.scale[0]);
}

inline bool scale_channel(Descriptor& descriptor, ChannelKind kind, double factor) {
  return change_channels(descriptor, kind, [&](Channel& channel) {
    for (double& scale : channel.scale) scale *= factor;
  });
}

// Scales of a vector's three numbers times these; of one with axes, those of its axes.
inline bool scale_axes(Descriptor& descriptor, ChannelKind kind, const std::array<double, 3>& factors) {
  return change_channels(descriptor, kind, [&](Channel& channel) {
    spread(channel, descriptor);
    for (std::size_t i = 0; i < channel.scale.size(); ++i)
      channel.scale[i] *= factors[channel.axes.empty() ? i : static_cast<std::size_t>(channel.axes[i])];
  });
}

inline bool ends_with_one_of(const std::string& name, const std::vector<std::string>& ends) {
  return std::ranges::any_of(ends, [&](const std::string& end) { return name.find(end) != std::string::npos; });
}

// Entries of joints in another of the usual orders, by its place among them.
inline std::vector<int> order_of(const Descriptor& descriptor, const RobotModel& robot, int order) {
  std::vector<int> from(descriptor.joints.size()), moved;
  for (std::size_t j = 0; j < from.size(); ++j) from[j] = static_cast<int>(j);
  const JointOrder usual = usual_joint_orders(robot)[order];
  for (const std::string& name : usual.joints)
    for (std::size_t j = 0; j < from.size(); ++j)
      if (descriptor.joints[j].name == name && descriptor.joints[j].action) moved.push_back(static_cast<int>(j));
  std::size_t next = 0;
  for (std::size_t j = 0; j < from.size(); ++j)
    if (descriptor.joints[j].action) from[j] = moved[next++];
  return from;
}

inline bool swap_joints(Descriptor& descriptor, const std::string& a, const std::string& b) {
  const std::vector<DescriptorJoint> joints = descriptor.joints;
  bool changed = false;
  for (std::size_t i = 0; i < joints.size(); ++i) {
    std::string other = joints[i].name;
    const auto at = other.find(a);
    if (at == std::string::npos) continue;
    other.replace(at, a.size(), b);
    const auto found = std::ranges::find(joints, other, &DescriptorJoint::name);
    if (found == joints.end()) continue;
    std::swap(descriptor.joints[i], descriptor.joints[found - joints.begin()]);
    changed = true;
  }
  return changed;
}

inline bool flip_joints(Descriptor& descriptor, const std::vector<std::string>& names, bool action, bool seen) {
  bool changed = false;
  for (std::size_t j = 0; j < descriptor.joints.size(); ++j) {
    DescriptorJoint& joint = descriptor.joints[j];
    if (!joint.action || !ends_with_one_of(joint.name, names)) continue;
    changed = true;
    if (action && seen) joint.neutral = -joint.neutral;
    if (action) joint.action = -*joint.action;
    if (!seen) continue;
    for (const ChannelKind kind : {ChannelKind::kJointPosition, ChannelKind::kJointVelocity})
      change_channels(descriptor, kind, [&](Channel& channel) {
        spread(channel, descriptor);
        for (std::size_t k = 0; k < channel.joints.size(); ++k)
          if (channel.joints[k] == static_cast<int>(j)) channel.scale[k] *= -1.0;
      });
  }
  return changed;
}

inline bool swap_channels(Descriptor& descriptor, ChannelKind a, ChannelKind b) {
  for (ChannelGroup& group : descriptor.observation.groups) {
    const auto of = [&](ChannelKind kind) { return std::ranges::find(group.channels, kind, &Channel::kind); };
    if (of(a) == group.channels.end() || of(b) == group.channels.end()) continue;
    std::iter_swap(of(a), of(b));
    return true;
  }
  ObservationInput& input = descriptor.observation.inputs[0];
  const auto part_of = [&](ChannelKind kind) {
    return std::ranges::find_if(input.parts, [&](const InputPart& part) {
      return part.groups.size() == 1 && descriptor.observation.groups[part.groups[0]].channels[0].kind == kind;
    });
  };
  if (part_of(a) == input.parts.end() || part_of(b) == input.parts.end()) return false;
  std::iter_swap(part_of(a), part_of(b));
  return true;
}

// The reading of that part whose words contain `said`.
inline bool take_reading(Descriptor& descriptor, const RobotModel& robot, ContractPart part, const std::string& said) {
  std::vector<Reading> readings = other_readings(descriptor, robot);
  for (Reading& reading : readings)
    if (reading.part == part && reading.said.find(said) != std::string::npos) {
      descriptor = std::move(reading.descriptor);
      return true;
    }
  return false;
}

inline bool scale_actions(Descriptor& descriptor, double factor) {
  for (DescriptorJoint& joint : descriptor.joints)
    if (joint.action) joint.action = *joint.action * factor;
  return true;
}

template <typename Change>
bool change_joints(Descriptor& descriptor, const Change& change) {
  for (DescriptorJoint& joint : descriptor.joints)
    if (joint.action) change(joint);
  return true;
}

// Numbers of the joints from a list in the card's order, given to the joints in theirs.
inline bool list_numbers(Descriptor& descriptor, const RobotModel& robot, bool gains) {
  const std::vector<DescriptorJoint> joints = descriptor.joints;
  const std::vector<int> from = order_of(descriptor, robot, 0);
  for (std::size_t j = 0; j < joints.size(); ++j) {
    DescriptorJoint& joint = descriptor.joints[j];
    const DescriptorJoint& listed = joints[from[j]];
    if (gains) joint.kp = listed.kp;
    if (gains) joint.kd = listed.kd;
    if (!gains) joint.neutral = listed.neutral;
  }
  return true;
}

inline bool change_clocks(Descriptor& descriptor, const std::function<void(GaitClock&)>& change) {
  bool changed = false;
  for (const ChannelKind kind : {ChannelKind::kGaitSine, ChannelKind::kGaitCosine})
    changed |= change_channels(descriptor, kind, [&](Channel& channel) { change(channel.gait); });
  return changed;
}

inline std::vector<InjectedDefect> injected_defects() {
  using P = ContractPart;
  using K = ChannelKind;
  using D = Descriptor;
  using R = RobotModel;
  return {
      {"joints in the motors' order, not IsaacLab's", "unitree_rl_lab", P::kJointOrder,
       [](D& d, const R& r) {
         d = with_joints_permuted(d, order_of(d, r, 0));
         return true;
       }},
      {"joints in IsaacLab's order, not the motors'", "holosoma", P::kJointOrder,
       [](D& d, const R& r) {
         d = with_joints_permuted(d, order_of(d, r, 1));
         return true;
       }},
      {"hips' pitch and yaw exchanged", "rl_gym", P::kJointOrder,
       [](D& d, const R&) { return swap_joints(d, "hip_pitch", "hip_yaw"); }},
      {"left and right exchanged", "unitree_rl_mjlab", P::kJointOrder,
       [](D& d, const R&) { return swap_joints(d, "left", "right"); }},
      {"one joint turns the other way", "g1_deploy_velocity", P::kJointSign,
       [](D& d, const R&) { return flip_joints(d, {"right_hip_roll"}, true, true); }},
      {"the knees' actions are negated", "rl_gym_h1", P::kJointSign,
       [](D& d, const R&) { return flip_joints(d, {"knee"}, true, false); }},
      {"the ankles' angles are shown negated", "holosoma_fastsac", P::kJointSign,
       [](D& d, const R&) { return flip_joints(d, {"ankle_pitch"}, false, true); }},
      {"actions without their scale (1 for 0.25)", "holosoma_t1", P::kActionScale,
       [](D& d, const R&) { return scale_actions(d, 4.0); }},
      {"actions scaled that are not", "playground_t1", P::kActionScale,
       [](D& d, const R&) { return scale_actions(d, 0.25); }},
      {"joint rates without their scale", "rl_gym", P::kObservationScale,
       [](D& d, const R&) { return scale_channel(d, K::kJointVelocity, 20.0); }},
      {"joint rates scaled that are not", "unitree_rl_mjlab", P::kObservationScale,
       [](D& d, const R&) { return scale_channel(d, K::kJointVelocity, 0.05); }},
      {"a gyro in degrees", "g1_deploy_amp", P::kObservationScale,
       [](D& d, const R&) { return scale_channel(d, K::kBaseAngularVelocity, 180.0 / std::numbers::pi); }},
      {"a gyro turned by 180 degrees about z", "holosoma", P::kGyro,
       [](D& d, const R&) {
         return scale_axes(d, K::kBaseAngularVelocity, {-1, -1, 1});
       }},
      {"a gyro with x and y exchanged", "falcon", P::kGyro,
       [](D& d, const R&) {
         return change_channels(d, K::kBaseAngularVelocity, [](Channel& channel) { channel.axes = {1, 0, 2}; });
       }},
      {"gravity points up", "booster_gym", P::kGravity,
       [](D& d, const R&) {
         return scale_axes(d, K::kGravity, {-1, -1, -1});
       }},
      {"gravity of a quaternion in the other order (xyzw for wxyz), at a heading of 0", "falcon_dec_loco", P::kGravity,
       [](D& d, const R&) {
         return scale_axes(d, K::kGravity, {-1, 0, 1});
       }},
      {"a history frame by frame that is term by term", "unitree_rl_lab", P::kHistory,
       [](D& d, const R& r) { return take_reading(d, r, P::kHistory, "frame by frame"); }},
      {"a history term by term that is frame by frame", "homie", P::kHistory,
       [](D& d, const R& r) { return take_reading(d, r, P::kHistory, "term by term"); }},
      {"a history without the present frame", "g1_deploy_amp", P::kHistory,
       [](D& d, const R& r) { return take_reading(d, r, P::kHistory, "without the present"); }},
      {"a clock's sine and cosine exchanged", "booster_gym", P::kClock,
       [](D& d, const R&) { return swap_channels(d, K::kGaitSine, K::kGaitCosine); }},
      {"a clock's two feet in step", "playground", P::kClock,
       [](D& d, const R&) {
         return change_clocks(d, [](GaitClock& gait) { gait.phases.back() = gait.phases.front(); });
       }},
      {"commands without their scale", "homie", P::kCommand,
       [](D& d, const R&) {
         return scale_axes(d, K::kCommandVelocity, {0.5, 0.5, 1});
       }},
      {"a commanded yaw rate of the opposite sign", "g1_deploy_velocity", P::kCommand,
       [](D& d, const R&) {
         return scale_axes(d, K::kCommandVelocity, {1, 1, -1});
       }},
      {"a default pose of zeros", "holosoma", P::kDefaultPose,
       [](D& d, const R&) { return change_joints(d, [](DescriptorJoint& joint) { joint.neutral = 0.0; }); }},
      {"gains listed in the motors' order", "unitree_rl_lab", P::kGains,
       [](D& d, const R& r) { return list_numbers(d, r, true); }},
      {"kp a quarter of its own", "falcon", P::kGains,
       [](D& d, const R&) { return change_joints(d, [](DescriptorJoint& joint) { joint.kp *= 0.25; }); }},
      {"half the rate", "humanoid_gym", P::kRate,
       [](D& d, const R&) {
         d.rate_hz *= 0.5;
         return true;
       }},
      {"actions clipped at 1 that are not", "holosoma_t1", P::kActionClip,
       [](D& d, const R&) {
         d.action_clip = 1.0;
         return true;
       }},
      {"gyro and gravity exchanged", "g1_deploy_velocity", P::kChannelOrder,
       [](D& d, const R&) { return swap_channels(d, K::kBaseAngularVelocity, K::kGravity); }},
  };
}

}  // namespace duet::test
