// The record of every run, be it played back, simulated or on the robot: metrics and detectors see only this.
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "duet/core/robot_state.h"
#include "duet/core/task.h"

namespace duet {

// Points over time, (T, K, 3) in [m], frame W, stored contiguously in that order (as NumPy would).
class PointTracks {
 public:
  using Frame = Eigen::Map<Eigen::Matrix3Xd>;
  using ConstFrame = Eigen::Map<const Eigen::Matrix3Xd>;

  PointTracks() = default;
  // All zero. Throws std::invalid_argument for negative sizes.
  PointTracks(int frames, int points);
  // Takes (T, K, 3) data; throws std::invalid_argument where the size is not frames * points * 3.
  PointTracks(int frames, int points, std::vector<double> data);

  [[nodiscard]] int frames() const { return frames_; }
  [[nodiscard]] int points() const { return points_; }
  [[nodiscard]] bool empty() const { return data_.empty(); }
  [[nodiscard]] const std::vector<double>& data() const { return data_; }
  [[nodiscard]] std::vector<double>& data() { return data_; }

  // The K points of frame t as the columns of a 3 x K matrix. No range check.
  [[nodiscard]] Frame frame(int t) { return {data_.data() + offset(t, 0), 3, points_}; }
  [[nodiscard]] ConstFrame frame(int t) const { return {data_.data() + offset(t, 0), 3, points_}; }
  // One point at one time. No range check.
  [[nodiscard]] Eigen::Map<Eigen::Vector3d> at(int t, int k) {
    return Eigen::Map<Eigen::Vector3d>(&data_[offset(t, k)]);
  }
  [[nodiscard]] Eigen::Map<const Eigen::Vector3d> at(int t, int k) const {
    return Eigen::Map<const Eigen::Vector3d>(&data_[offset(t, k)]);
  }

  // The tracks of the chosen points, in the order given. Throws std::invalid_argument for an index out of range.
  [[nodiscard]] PointTracks select(const std::vector<int>& points) const;
  // Frames [begin, end). Throws std::invalid_argument where they are not inside.
  [[nodiscard]] PointTracks slice(int begin, int end) const;

  bool operator==(const PointTracks&) const = default;

 private:
  [[nodiscard]] size_t offset(int t, int k) const { return 3 * (static_cast<size_t>(t) * points_ + k); }

  int frames_ = 0;
  int points_ = 0;
  std::vector<double> data_;
};

struct RecordedContact {
  int frame = 0;
  Contact contact;
};

// Frame t is the state at time t / rate_hz; its reference and q_target are those that led *to* the next frame; its
// contacts are those of the last physics step before it. All vectors have T entries.
struct Recording {
  std::optional<Task> task;  // none: nobody said what it is
  Phases phases;             // of these frames
  double rate_hz = 50.0;
  std::vector<RobotState> robot;
  std::vector<Reference> reference;
  std::vector<Eigen::VectorXd> q_target;  // the joint command's targets [rad]
  PointTracks partner;                    // (T, 24, 3), SMPL-24 joints of the human partner; empty: none
  std::vector<RecordedContact> contacts;  // in order of frame
  Outcome outcome = Outcome::kOk;
  std::string message;  // why, where outcome is not kOk

  [[nodiscard]] int frames() const { return static_cast<int>(robot.size()); }
};

// The 24-joint SMPL skeleton: names, parents, left-right pairs. Order and names as in SMPL (Loper et al. 2015).

inline constexpr int kSmplJoints = 24;

enum SmplJoint : int {
  kPelvis,
  kLeftHip,
  kRightHip,
  kSpine1,
  kLeftKnee,
  kRightKnee,
  kSpine2,
  kLeftAnkle,
  kRightAnkle,
  kSpine3,
  kLeftToe,
  kRightToe,
  kNeck,
  kLeftCollar,
  kRightCollar,
  kHead,
  kLeftShoulder,
  kRightShoulder,
  kLeftElbow,
  kRightElbow,
  kLeftWrist,
  kRightWrist,
  kLeftHand,
  kRightHand,
};

// "pelvis", "left_hip", ..., "right_hand"; toes are SMPL's left_foot and right_foot, named left_toe and right_toe here.
inline constexpr std::array<std::string_view, kSmplJoints> kSmplNames = {
    "pelvis",     "left_hip",    "right_hip",    "spine1",      "left_knee",     "right_knee",
    "spine2",     "left_ankle",  "right_ankle",  "spine3",      "left_toe",      "right_toe",
    "neck",       "left_collar", "right_collar", "head",        "left_shoulder", "right_shoulder",
    "left_elbow", "right_elbow", "left_wrist",   "right_wrist", "left_hand",     "right_hand"};

inline constexpr std::array<int, kSmplJoints> kSmplParents = {-1, 0, 0, 0,  1,  2,  3,  4,  5,  6,  7,  8,
                                                              9,  9, 9, 12, 13, 14, 16, 17, 18, 19, 20, 21};

// The joint of the other side; itself for the middle ones.
inline constexpr std::array<int, kSmplJoints> kSmplMirror = {0,  2,  1,  3,  5,  4,  6,  8,  7,  9,  11, 10,
                                                             12, 14, 13, 15, 17, 16, 19, 18, 21, 20, 23, 22};

// Index of an SMPL joint by name, -1 where unknown.
constexpr int smpl_index(std::string_view name) {
  for (int j = 0; j < kSmplJoints; ++j)
    if (kSmplNames[j] == name) return j;
  return -1;
}

// A robot's motion over time at a fixed rate: what PAIR produces, what motion files hold, what playback plays.

struct RobotMotion {
  double rate_hz = 50.0;
  std::vector<std::string> joint_names;  // names of the columns of q
  std::vector<Pose> root;                // X_WB per frame, T entries
  Eigen::MatrixXd q;                     // (joints, T) [rad]; one column is one frame

  [[nodiscard]] int frames() const { return static_cast<int>(root.size()); }
  [[nodiscard]] Reference reference(int frame) const { return {root[frame], q.col(frame)}; }
};

// Throws std::invalid_argument naming what is wrong: sizes that disagree, a value that is not finite, a quaternion that
// is not unit (to 1e-6), a rate that is not positive. `what` names the motion in the message.
void validate(const RobotMotion& motion, const std::string& what);

// At another rate, first instant kept: positions and angles linear, rotations slerp; frames are never skipped. Throws
// std::invalid_argument for a motion without frames or a rate that is not positive.
RobotMotion resample(const RobotMotion& motion, double rate_hz);

}  // namespace duet
