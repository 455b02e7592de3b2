// The network's input, made from an observation: the same code for training and rollouts, so that they cannot differ.
// Ego-centric (A.3.1): frame E stands on the ground below the robot's root as it is now, x along its heading, z up.
#pragma once

#include <Eigen/Core>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "duet/policies/policy.h"
#include "duet/robots/kinematics.h"

namespace duet {

// The shape of a D-STAR network (supplement A.2) as data: what a file says of itself and what a trainer is asked for.
// The paper's dimensions are the defaults where it states them; depth, heads and widths, which it does not, are those
// of the network that ships. docs/deviations.md says why.

struct DstarConfig {
  // Long-short temporal encoder: each stream a pre-norm transformer over its frames, the newest frame's token read out.
  int long_frames = kHistoryFrames, short_frames = 6;
  int long_stride = 20;  // ticks between the long stream's frames: 4.4 s; printed: 1, which are 0.22 s
  int width = 128, heads = 4, feedforward = 256, layers = 2;
  int stream = 768;    // what each stream gives
  int temporal = 256;  // f_temp
  // Phase attention: f_temp as `tokens` tokens in each of the three experts.
  int tokens = 8, phase_hidden = 64;
  int phase = 256;  // f_phase
  // Multi-scale spatial reasoning.
  int zone = 16, orientation = 32;  // outputs of the distance and orientation encoders
  int field = 128, field_hidden = 256, fusion_heads = 4;
  int spatial = 128;   // f_MSS
  int language = 768;  // with f_temp, f_phase and f_MSS: the condition, 1408
  // Diffusion head: 1-D convolutions of 3 over the anchors, group norm, FiLM by the condition and by the step.
  int condition = 256;  // the 1408 projected
  int channels = 168, blocks = 4, groups = 8, step_embedding = 64;
  int training_steps = 50, inference_steps = 10;  // F: DDIM, squared-cosine
  // Ablations; what is off is neither computed nor in the file, and the condition is shorter by it.
  bool phase_attention = true, spatial_reasoning = true, short_stream = true, language_on = true;

  [[nodiscard]] int condition_inputs() const {
    return temporal + (phase_attention ? phase : 0) + (spatial_reasoning ? spatial : 0) + (language_on ? language : 0);
  }
  bool operator==(const DstarConfig&) const = default;
};

inline constexpr int kPhases = 3;
inline constexpr int kZones = 3;                          // 0-0.3, 0.3-0.8, 0.8 m and more
inline constexpr int kAnchorSize = 36;                    // root 3, quaternion wxyz 4, joints 29
inline constexpr int kPlanSize = kAnchors * kAnchorSize;  // row-major (anchor, value)

// JSON text with every field, in a fixed order; and back. Throws InputError naming `file`, the field, expected, found:
// an unknown or missing field, a value out of range, sizes that do not divide (width by heads, temporal by tokens,
// field by fusion_heads, channels by groups).
std::string to_json_text(const DstarConfig& config);
DstarConfig parse_dstar_config(const std::string& text, const std::string& file);
// The first of those that is wrong with a configuration made otherwise; "" where nothing is.
std::string config_problem(const DstarConfig& config);

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
