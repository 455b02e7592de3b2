// The published controllers as measured outside of duet, in MuJoCo with their own code: commands, starts and
// references.
#pragma once

#include <algorithm>
#include <iterator>
#include <sstream>
#include <string>

#include "duet/archives/pickle/pickle_fields.h"
#include "duet/core/file.h"
#include "duet/nn/catalogue/load_network.h"
#include "tests/controllers/walk.h"
#include "tests/support.h"

namespace duet::test {

// A file of the shared data by the name under which descriptors and cards look for it; "": absent.
inline std::string published_file(const std::string& name) {
  const std::string model = shared_file("models/" + name);
  return model.empty() ? shared_file("arena/" + name) : model;
}

// With the network of the shared data.
inline WalkSetup published(const std::string& name) {
  return {.controller = name, .options = {{"network", published_file(load_descriptor(name).network)}}};
}

// HOMIE under a velocity command, or one with a height; "": under the root of the reference commands.
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

// A walker at a fixed velocity, its arms hanging at 0 where they follow the reference.
inline WalkSetup walker(const std::string& name, const std::string& command, double seconds = 6.0) {
  WalkSetup setup = commanded(name, command);
  setup.seconds = seconds;
  if (name.starts_with("falcon")) setup.start = arms_down(*body("g1"));
  return setup;
}

// FALCON at a velocity; from 1 s on both arms rise forward by 1 rad within a second.
inline WalkSetup falcon_with_raised_arms(const std::string& command) {
  const auto robot = body("g1");
  const int left = robot->joint_index("left_shoulder_pitch_joint");
  const int right = robot->joint_index("right_shoulder_pitch_joint");
  WalkSetup setup = walker("falcon", command);
  setup.reference = [=](int tick, const Reference& neutral) {
    Reference reference = neutral;
    reference.q[left] = reference.q[right] = -std::clamp((tick - 50) / 50.0, 0.0, 1.0);
    return reference;
  };
  return setup;
}

// A motion as the reference of a tracker, begun where the robot stands; the robot begins in its neutral pose.
inline WalkSetup tracked(const std::string& name, RobotMotion motion) {
  const Pose first{yaw_rotation(yaw_of(motion.root[0].R)), {motion.root[0].p.x(), motion.root[0].p.y(), 0.0}};
  for (Pose& root : motion.root) root = first.inverse() * root;
  WalkSetup setup = published(name);
  setup.seconds = (motion.frames() - 1) / 50.0;
  setup.reference = [motion](int tick, const Reference&) { return motion.reference(tick); };
  return setup;
}

// The motion that BeyondMimic's network was trained on: its outputs beside the action, by time_step.
inline RobotMotion beyond_mimic_motion(int frames, const std::string& controller = "beyond_mimic") {
  const auto robot = body("g1");
  const Descriptor descriptor = load_descriptor(controller);
  const auto network = load_network(published_file(descriptor.network));
  std::vector<float> obs(network->inputs()[0].size), step(1);
  std::vector<std::vector<float>> values;
  for (const Port& port : network->outputs()) values.emplace_back(port.size);
  const std::span<const float> inputs[] = {obs, step};
  const std::vector<std::span<float>> outputs(values.begin(), values.end());
  const auto value = [&](const std::string& output) {
    for (size_t i = 0; i < values.size(); ++i)
      if (network->outputs()[i].name == output) return values[i];
    return std::vector<float>();
  };
  RobotMotion motion{.joint_names = robot->joint_names(), .root = {}, .q = Eigen::MatrixXd(robot->dof(), frames)};
  for (int t = 0; t < frames; ++t) {
    step[0] = static_cast<float>(t);
    network->run(inputs, outputs);
    const std::vector<float> q = value("joint_pos"), p = value("body_pos_w"), R = value("body_quat_w");
    for (size_t j = 0; j < q.size(); ++j)
      motion.q(robot->joint_index(descriptor.joints[j].name), t) = static_cast<double>(q[j]);
    motion.root.push_back({Eigen::Quaterniond(R[0], R[1], R[2], R[3]).normalized(), {p[0], p[1], p[2]}});
  }
  return motion;
}

// rl_sar's dance: a row per frame of place, quaternion (x, y, z, w) and 29 angles, played at 50 Hz.
constexpr const char* kDance = "models/rl_sar/G1_Take_102.bvh_60hz.csv";

inline RobotMotion rl_sar_dance() {
  std::istringstream lines(read_text(shared_file(kDance)));
  std::vector<std::vector<double>> rows;
  for (std::string line; std::getline(lines, line);) {
    std::ranges::replace(line, ',', ' ');
    std::istringstream numbers(line);
    rows.emplace_back(std::istream_iterator<double>(numbers), std::istream_iterator<double>());
  }
  const auto robot = body("g1");
  RobotMotion motion{.joint_names = robot->joint_names(), .root = {}, .q = Eigen::MatrixXd(29, rows.size())};
  for (size_t t = 0; t < rows.size(); ++t) {
    const std::vector<double>& row = rows[t];
    motion.root.push_back({Eigen::Quaterniond(row[6], row[3], row[4], row[5]).normalized(), {row[0], row[1], row[2]}});
    motion.q.col(static_cast<Eigen::Index>(t)) = Eigen::Map<const Eigen::VectorXd>(row.data() + 7, 29);
  }
  return motion;
}

// MuJoCo's own default, which the reference measurements have: its contacts give way twice as slowly as duet's 0.01 s.
inline WalkSetup on_soft_ground(WalkSetup setup) {
  setup.engine_options = {{"ground_time_constant", "0.02"}};
  return setup;
}

}  // namespace duet::test
