// Robots and clips for the tests of PAIR: the G1, a small robot with slanted hinge axes, and smooth random people.
#pragma once

#include <Eigen/Geometry>
#include <array>
#include <cmath>
#include <random>

#include "duet/core/recording.h"
#include "duet/motion/interaction_clip.h"
#include "duet/robots/robot_model.h"

namespace duet::test {

// Mangled apart from the shared pointers of that name in other rooms: a program may have both.
inline namespace of_retarget {
inline const RobotModel& g1() {
  static const RobotModel model = load_robot(default_card_path());
  return model;
}
}  // namespace of_retarget

// Offsets of a standing person's joints from their parents (A pose, arms half down), 1.7 m tall. [m]
inline std::array<Eigen::Vector3d, kSmplJoints> person_offsets() {
  const auto side = [](double x, double y, double z, bool left) { return Eigen::Vector3d(x, left ? y : -y, z); };
  std::array<Eigen::Vector3d, kSmplJoints> o;
  o[kPelvis] = {0.0, 0.0, 0.93};
  for (const bool left : {true, false}) {
    o[left ? kLeftHip : kRightHip] = side(0.0, 0.07, -0.09, left);
    o[left ? kLeftKnee : kRightKnee] = side(0.01, 0.02, -0.38, left);
    o[left ? kLeftAnkle : kRightAnkle] = side(-0.03, 0.0, -0.39, left);
    o[left ? kLeftToe : kRightToe] = side(0.13, 0.02, -0.05, left);
    o[left ? kLeftCollar : kRightCollar] = side(0.0, 0.08, 0.11, left);
    o[left ? kLeftShoulder : kRightShoulder] = side(-0.01, 0.11, 0.04, left);
    o[left ? kLeftElbow : kRightElbow] = side(0.0, 0.16, -0.19, left);
    o[left ? kLeftWrist : kRightWrist] = side(0.10, 0.13, -0.18, left);
    o[left ? kLeftHand : kRightHand] = side(0.04, 0.04, -0.05, left);
  }
  o[kSpine1] = {-0.01, 0.0, 0.11};
  o[kSpine2] = {0.0, 0.0, 0.13};
  o[kSpine3] = {0.01, 0.0, 0.06};
  o[kNeck] = {-0.02, 0.0, 0.21};
  o[kHead] = {0.04, 0.0, 0.09};
  return o;
}

// Smooth random motion of one person around (x, y, yaw): each joint swings, arms most.
inline HumanMotion random_person(int frames, double rate_hz, unsigned seed, double x, double yaw) {
  std::mt19937 engine(seed);
  std::uniform_real_distribution<double> uniform(-1.0, 1.0);
  struct Swing {
    Eigen::Vector3d amplitude, frequency, phase;
    [[nodiscard]] Eigen::Vector3d at(double t) const {
      return (amplitude.array() * (6.2832 * frequency.array() * t + phase.array()).sin()).matrix();
    }
  };
  std::vector<Swing> swings(kSmplJoints);
  const auto draw = [&](double scale) -> Eigen::Vector3d {
    return Eigen::Vector3d(uniform(engine), uniform(engine), uniform(engine)) * scale;
  };
  for (int j = 0; j < kSmplJoints; ++j) {
    const bool arm = j == kLeftShoulder || j == kRightShoulder || j == kLeftElbow || j == kRightElbow;
    swings[j] = {draw(arm ? 0.5 : 0.12), Eigen::Vector3d::Constant(0.45) + draw(0.3), draw(3.0)};
  }
  HumanMotion motion;
  motion.rate_hz = rate_hz;
  motion.joints = PointTracks(frames, kSmplJoints);
  const auto offsets = person_offsets();
  for (int t = 0; t < frames; ++t) {
    const double time = t / rate_hz;
    std::array<Eigen::Quaterniond, kSmplJoints> R;
    for (int j = 0; j < kSmplJoints; ++j) {
      const Eigen::Vector3d w = swings[j].at(time);
      const Eigen::Quaterniond turn(
          Eigen::AngleAxisd(w.norm(), w.norm() > 0 ? w.normalized() : Eigen::Vector3d::UnitZ()));
      const int parent = kSmplParents[j];
      R[j] = (parent < 0 ? yaw_rotation(yaw) : R[parent]) * turn;
      const Eigen::Vector3d base(x + 0.1 * std::sin(time), 0.05 * std::cos(1.3 * time), 0.0);
      const Eigen::Vector3d from = parent < 0 ? base : Eigen::Vector3d(motion.joints.at(t, parent));
      motion.joints.at(t, j) = from + (parent < 0 ? offsets[j] : R[parent] * offsets[j]);
      motion.rotations.push_back(R[j].normalized());
    }
  }
  return motion;
}

inline InteractionClip random_clip(int frames, unsigned seed, double rate_hz = 50.0) {
  InteractionClip clip;
  clip.id = "random-" + std::to_string(seed);
  clip.a = random_person(frames, rate_hz, seed, 0.0, 0.0);
  clip.b = random_person(frames, rate_hz, seed + 1000, 0.9, 3.0);
  clip.phases = {frames / 3, 2 * frames / 3};
  return clip;
}

// 16 frames on a tree of hinges about slanted axes: what the G1 with its coordinate axes leaves untried.
inline RobotModel slanted_robot() {
  const RobotModel& model = g1();
  RobotModel robot = model;
  robot.name = "slanted";
  std::mt19937 engine(7);
  std::uniform_real_distribution<double> uniform(-1.0, 1.0);
  for (std::size_t i = 1; i < robot.links.size(); ++i) {
    Eigen::Vector3d axis(uniform(engine), uniform(engine), uniform(engine));
    robot.links[i].axis = i % 5 == 0 ? Eigen::Vector3d(-Eigen::Vector3d::UnitX()) : axis.normalized();
  }
  return robot;
}

}  // namespace duet::test
