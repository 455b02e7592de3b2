// Shared by the tests of robots/: the G1 loaded once, random states, and small robots written to a scratch folder.
#pragma once

#include <fmt/format.h>
#include <gmock/gmock.h>

#include <Eigen/Geometry>
#include <string>

#include "duet/core/file.h"
#include "duet/core/numbers.h"
#include "duet/core/require.h"
#include "duet/robots/robot_model.h"
#include "tests/support.h"

namespace duet::test {

inline const RobotModel& g1() {
  static const RobotModel model = load_robot(DUET_SOURCE_DIR "/robots/g1/g1.yaml");
  return model;
}

inline std::string g1_card() { return std::string(DUET_SOURCE_DIR) + "/robots/g1/g1.yaml"; }

inline Eigen::Vector3d random_vector(Random& random, double size = 1.0) {
  return {random.uniform(-size, size), random.uniform(-size, size), random.uniform(-size, size)};
}

inline Pose random_pose(Random& random) {
  const Eigen::Vector3d axis = random_vector(random).normalized();
  return {Eigen::Quaterniond(Eigen::AngleAxisd(random.uniform(-3.0, 3.0), axis)), random_vector(random, 2.0)};
}

// Joints inside their limits, velocities up to 3.
inline RobotState random_state(const RobotModel& model, Random& random) {
  RobotState state;
  state.X_WB = random_pose(random);
  state.v_WB = random_vector(random, 2.0);
  state.w_WB_B = random_vector(random, 3.0);
  state.q.resize(model.dof());
  state.v.resize(model.dof());
  for (int j = 0; j < model.dof(); ++j) {
    state.q[j] = random.uniform(model.joints[j].lower, model.joints[j].upper);
    state.v[j] = random.uniform(-3.0, 3.0);
  }
  return state;
}

// The state after moving with generalised velocity u (robots/kinematics.h) for a time h.
inline RobotState moved(const RobotState& state, const Eigen::VectorXd& u, double h) {
  RobotState next = state;
  next.X_WB.p += h * u.head<3>();
  const Eigen::Vector3d turn = h * u.segment<3>(3);
  if (turn.norm() > 0.0)
    next.X_WB.R = state.X_WB.R * Eigen::Quaterniond(Eigen::AngleAxisd(turn.norm(), turn.normalized()));
  next.q += h * u.tail(state.q.size());
  return next;
}

inline Eigen::VectorXd generalised_velocity(const RobotState& state) {
  Eigen::VectorXd u(6 + state.v.size());
  u << state.v_WB, state.w_WB_B, state.v;
  return u;
}

inline std::string replaced(std::string text, const std::string& from, const std::string& to) {
  const size_t at = text.find(from);
  require(at != std::string::npos, "fixture: no '" + from + "' to replace");
  return text.replace(at, from.size(), to);
}

// A base with a hinge, a part fixed to the hinged link, and a second hinge behind it about a skew axis.
inline const std::string kSmallUrdf = R"(<?xml version="1.0"?>
<robot name="small">
  <link name="base">
    <inertial><origin xyz="0 0 0.1"/><mass value="2"/><inertia ixx="0.02" iyy="0.03" izz="0.025" ixy="0" ixz="0" iyz="0"/></inertial>
  </link>
  <joint name="shoulder" type="revolute">
    <parent link="base"/><child link="upper"/><origin xyz="0.1 0.2 0.3" rpy="0.1 0.2 0.3"/><axis xyz="0 1 0"/>
    <limit lower="-1" upper="2" effort="10" velocity="5"/>
  </joint>
  <link name="upper">
    <inertial><origin xyz="0 0 -0.1"/><mass value="1"/><inertia ixx="0.01" iyy="0.01" izz="0.002" ixy="0" ixz="0" iyz="0"/></inertial>
    <visual><geometry><mesh filename="package://nowhere/upper.STL"/></geometry></visual>
    <collision><geometry><mesh filename="meshes/upper.STL"/></geometry></collision>
  </link>
  <joint name="weld" type="fixed">
    <parent link="upper"/><child link="brick"/><origin xyz="0.05 0 -0.2" rpy="0 0 1.5707963267948966"/>
  </joint>
  <link name="brick">
    <inertial><origin xyz="0.02 0 0"/><mass value="3"/><inertia ixx="0.003" iyy="0.004" izz="0.005" ixy="0.0001" ixz="0" iyz="0"/></inertial>
  </link>
  <joint name="elbow" type="continuous">
    <parent link="brick"/><child link="lower"/><origin xyz="0 0 -0.1"/><axis xyz="1 1 0"/><limit effort="7" velocity="8"/>
  </joint>
  <link name="lower">
    <inertial><origin xyz="0 0 -0.1"/><mass value="0.5"/><inertia ixx="0.001" iyy="0.001" izz="0.001" ixy="0" ixz="0" iyz="0"/></inertial>
  </link>
</robot>
)";

inline const std::string kSmallCard = R"(name: small
urdf: small.urdf
base: base
joints:
  - {name: shoulder, armature: 0.01, kp: 20, kd: 1, neutral: 0.5}
  - {name: elbow, armature: 0.02, kp: 10, kd: 0.5}
frames:
  - {name: tip, link: lower, xyz: [0, 0, -0.2], rpy: [0, 0, 1.5]}
pairs:
  - {frame: base, smpl: pelvis}
keypoints:
  - {name: hand, frame: tip, smpl: right_hand}
tracks: {rhand: tip}
shapes:
  - {link: brick, kind: capsule, from: [0, 0, 0], to: [0.1, 0, 0], radius: 0.02, region: arm}
  - {link: lower, kind: sphere, center: [0, 0, -0.2], radius: 0.03, region: hand, sole: true}
)";

// Loads the small robot from texts; files are named small.yaml and small.urdf.
inline RobotModel load_small(const std::string& card = kSmallCard, const std::string& urdf = kSmallUrdf) {
  const ScratchFolder folder;
  write_file(folder / "small.yaml", card);
  write_file(folder / "small.urdf", urdf);
  return load_robot(folder / "small.yaml");
}

// The message of the InputError that loading throws.
inline std::string load_error(const std::string& card, const std::string& urdf) {
  return thrown_message<InputError>([&] { load_small(card, urdf); });
}

}  // namespace duet::test
