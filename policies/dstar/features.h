// The network's input, made from an observation: the same code for training and rollouts, so that they cannot differ.
// Ego-centric (A.3.1): frame E stands on the ground below the robot's root as it is now, x along its heading, z up.
#pragma once

#include <Eigen/Core>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "duet/policies/dstar/config.h"
#include "duet/policies/policy.h"
#include "duet/robots/kinematics.h"

namespace duet {

inline constexpr int kFrameSize = kObservationSize;  // 149 per frame
// The number of relations that MSS looks at: partner's root, head and hands from the robot's root, head and hands.
inline constexpr int kRelations = 6;
inline constexpr int kPositionBands = 4;  // sinusoids per axis: wavelengths 4, 2, 1, 0.5 m
inline constexpr int kPositionSize = kRelations * 3 * 2 * kPositionBands;  // 144
inline constexpr int kOrientationSize = 12;

// Column i is frame i, oldest first.
using DstarFrames = Eigen::Matrix<float, kFrameSize, kHistoryFrames>;

struct DstarFeatures {
  // Per frame: partner's root in E (3), SMPL joints from that root in E's axes (72), robot:
  // base velocities in B (3 + 3), gravity in B (3), q - neutral (29), v (29), root in E (3), orientation in E wxyz (4).
  DstarFrames frames;
  DstarFrames past;  // the long stream's: further apart, the last one is now, all in E of now
  Eigen::Matrix<float, kPositionSize, 1> position;        // sinusoids of the relations' vectors, now
  Eigen::Matrix<float, kRelations, 1> distance;           // their lengths [m]
  Eigen::Matrix<float, kOrientationSize, 1> orientation;  // bearing and facing as sine and cosine of 1x, 2x, 3x
};

// Names of the 149 channels in order ("partner_root.x", ..., "joint_velocity.left_hip_pitch_joint", ...): what a file
// binds by.
std::vector<std::string> channel_names(const RobotModel& robot);

// Keeps buffers: no allocation in make(). One owner, not thread-safe.
class FeatureMaker {
 public:
  // Throws std::invalid_argument for a robot without the keypoints head, lhand and rhand or with other than 29 joints.
  explicit FeatureMaker(std::shared_ptr<const RobotModel> robot);
  // `past`: kHistoryFrames frames for the long stream, oldest first (PastFrames).
  void make(const Observation& observation, std::span<const ObservationFrame> past, DstarFeatures& features);
  // Where the long stream's frames are those of the observation: long_stride 1.
  void make(const Observation& observation, DstarFeatures& features) {
    make(observation, observation.history, features);
  }

 private:
  std::shared_ptr<const RobotModel> robot_;
  Kinematics kinematics_;
  int head_ = 0, left_hand_ = 0, right_hand_ = 0;  // frames of the robot
};

// Frame E of a robot state: x, y of its root on the ground, its heading.
Pose ego_frame(const RobotState& state);

// Anchors <-> the 180 numbers of the head, in E: per anchor root position (3), quaternion wxyz with w >= 0 (4), joints
// relative to neutral (29). decode_plan makes quaternions unit and clamps joints to their limits.
void encode_plan(const Anchors& anchors, const Pose& X_WE, const RobotModel& robot, std::span<float> plan);
Anchors decode_plan(std::span<const float> plan, const Pose& X_WE, const RobotModel& robot);

}  // namespace duet
