// The 24-joint SMPL skeleton: names, parents, left-right pairs. Order and names as in SMPL (Loper et al. 2015).
#pragma once

#include <array>
#include <string_view>

namespace duet {

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

}  // namespace duet
