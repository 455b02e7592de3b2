// The published controllers as measured outside of duet, in MuJoCo with their own code: commands, starts and
// references.
#pragma once

#include <algorithm>
#include <string>

#include "motion/pickle.h"
#include "tests/controllers/walk.h"
#include "tests/support.h"

namespace duet::test {

// With the network of the shared data.
inline WalkSetup published(const std::string& name) {
  return {.controller = name, .options = {{"network", shared_file("models/" + load_descriptor(name).network)}}};
}

// Of a velocity command, or of one with a height; "": the root of the reference commands.
inline WalkSetup homie(const std::string& command) {
  WalkSetup setup = published("homie");
  setup.start = arms_down(*body("g1_27dof"));
  if (!command.empty()) setup.options["command"] = command;
  return setup;
}

// Walking at 0.3 m/s; from 3 s on both arms rise forward by 1.5 rad within a second.
inline WalkSetup homie_with_raised_arms() {
  const auto robot = body("g1_27dof");
  const int left = robot->joint_index("left_shoulder_pitch_joint");
  const int right = robot->joint_index("right_shoulder_pitch_joint");
  WalkSetup setup = homie("0.3,0,0");
  setup.reference = [=](int tick, const Reference& neutral) {
    Reference reference = neutral;
    reference.q[left] = reference.q[right] = -1.5 * std::clamp((tick - 150) / 50.0, 0.0, 1.0);
    return reference;
  };
  return setup;
}

// In the pose around which its network acts, at the height that it is told when it idles.
inline WalkSetup twist2_idle() {
  const auto robot = body("g1_twist2");
  Eigen::VectorXd idle = robot->neutral;
  for (const DescriptorJoint& joint : load_descriptor("twist2").joints)
    idle[robot->joint_index(joint.name)] = joint.neutral;
  WalkSetup setup = published("twist2");
  setup.start = idle;
  setup.reference = [](int, const Reference& neutral) {
    Reference reference = neutral;
    reference.X_WB.p.z() = 0.8;
    return reference;
  };
  return setup;
}

constexpr const char* kRecordedWalk = "data/g1_motions/twist2/walk_001.pkl";

inline WalkSetup twist2_recorded_walk() {
  const RobotMotion motion = resample(read_motion_pickle(shared_file(kRecordedWalk)).motion, 50.0);
  WalkSetup setup = published("twist2");
  setup.seconds = (motion.frames() - 1) / 50.0;
  setup.reference = [motion](int tick, const Reference&) { return motion.reference(tick); };
  return setup;
}

inline WalkSetup commanded(const std::string& name, const std::string& command) {
  WalkSetup setup = published(name);
  setup.options["command"] = command;
  return setup;
}
inline WalkSetup playground() { return commanded("playground", "0.8,0,0"); }
inline WalkSetup rl_gym() { return commanded("rl_gym", "0.3,0,0"); }

// MuJoCo's own default, which the reference measurements have: its contacts give way twice as slowly as duet's 0.01 s.
inline WalkSetup on_soft_ground(WalkSetup setup) {
  setup.engine_options = {{"ground_time_constant", "0.02"}};
  return setup;
}

}  // namespace duet::test
