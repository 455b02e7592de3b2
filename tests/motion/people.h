// People for tests: a standing figure with plausible bones, moved rigidly over time.
#pragma once

#include <Eigen/Geometry>
#include <cmath>
#include <string>

#include "duet/core/robot_state.h"
#include "duet/motion/interaction_clip.h"

namespace duet::test {

// Joints of a person of 1.7 m in the reference posture: T pose on z = 0 at the origin, facing +x, left arm along +y.
inline Eigen::Matrix<double, 3, kSmplJoints> reference_posture() {
  Eigen::Matrix<double, 3, kSmplJoints> p;
  p << 0, 0, 0, 0, 0, 0, 0, -0.03, -0.03, 0, 0.1, 0.1, 0, 0, 0, 0.03, 0, 0, 0, 0, 0, 0, 0, 0,  //
      0, 0.09, -0.09, 0, 0.09, -0.09, 0, 0.09, -0.09, 0, 0.09, -0.09, 0, 0.07, -0.07, 0, 0.18, -0.18, 0.46, -0.46, 0.71,
      -0.71, 0.80, -0.80,  //
      0.93, 0.86, 0.86, 1.04, 0.48, 0.48, 1.17, 0.08, 0.08, 1.24, 0.02, 0.02, 1.44, 1.36, 1.36, 1.53, 1.40, 1.40, 1.40,
      1.40, 1.40, 1.40, 1.40, 1.40;
  return p;
}

// The reference posture as a rigid body that walks from `start` with `velocity` [m/s] while turning at `turn` [rad/s].
inline HumanMotion moving_person(int frames, double rate_hz, const Eigen::Vector3d& start,
                                 const Eigen::Vector3d& velocity = Eigen::Vector3d::Zero(), double yaw = 0.0,
                                 double turn = 0.0) {
  HumanMotion motion{.rate_hz = rate_hz, .joints = PointTracks(frames, kSmplJoints), .rotations = {}};
  for (int t = 0; t < frames; ++t) {
    const double time = t / rate_hz;
    const Pose X_WP{.R = yaw_rotation(yaw + turn * time), .p = start + time * velocity};
    for (int j = 0; j < kSmplJoints; ++j) {
      motion.joints.at(t, j) = X_WP * Eigen::Vector3d(reference_posture().col(j));
      motion.rotations.push_back(X_WP.R);
    }
  }
  return motion;
}

inline InteractionClip two_people(int frames = 20) {
  InteractionClip clip;
  clip.id = "pair_7";
  clip.task = Task::kHighFive;
  clip.a = moving_person(frames, 50.0, {-1.0, 0.1, 0.0}, {1.0, 0.0, 0.0}, 0.1, 0.3);
  clip.b = moving_person(frames, 50.0, {1.0, 0.0, 0.0}, {-0.5, 0.2, 0.0}, 3.0, -0.2);
  clip.phases = {.act_begin = 5, .act_end = 12};
  clip.reactor = Person::kA;
  clip.contacts = {{.begin = 6, .end = 8, .joint_a = kRightHand, .joint_b = kLeftHand}};
  clip.source = {{"file", "a.bvh"}, {"note", "two people, \xc3\xa4 to z"}};
  return clip;
}

}  // namespace duet::test
