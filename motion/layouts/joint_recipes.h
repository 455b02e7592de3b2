// Which column of a skeleton is which part of the body, by what joints are called in captures, trackers and models; and
// the SMPL-24 joints that follow from the parts. Pure functions.
#pragma once

#include <array>
#include <string>
#include <vector>

#include "duet/core/skeleton.h"

namespace duet {

// A weighted sum of the file's joints (weights add up to 1), moved a fixed way. Joints that a skeleton lacks are made
// of what it has, so that every SMPL joint has a recipe.
struct JointRecipe {
  struct Part {
    int column = 0;  // from the number of columns on: the SMPL joint column - size, which kRecipeOrder makes before
    double weight = 1.0;
  };
  std::vector<Part> parts;
  std::vector<Part> toward = {};  // a direction; weights add up to 0
  double reach = 0.0;             // along it, at most 0.4 of its length [m]
  double ahead = 0.0;             // along the level direction that hips and shoulders face [m]
  double down = 0.0;              // [m]
};

// Places of SMPL's spine joints on the way from pelvis to neck, of a collar on
// the way from the neck to the shoulder, and of toes from the ankle [m]:
// docs/file-formats.md, "People of fewer joints".
inline constexpr std::array<double, 3> kSpineAt = {0.21, 0.48, 0.60};
inline constexpr double kCollarOut = 0.38;
inline constexpr double kToeAhead = 0.12, kToeBelow = 0.05;

// The order in which the SMPL joints are made.
inline constexpr std::array<SmplJoint, kSmplJoints> kRecipeOrder = {
    kLeftHip,    kRightHip,    kLeftKnee,  kRightKnee,  kLeftAnkle, kRightAnkle, kLeftShoulder, kRightShoulder,
    kLeftElbow,  kRightElbow,  kNeck,      kHead,       kPelvis,    kSpine1,     kSpine2,       kSpine3,
    kLeftCollar, kRightCollar, kLeftWrist, kRightWrist, kLeftHand,  kRightHand,  kLeftToe,      kRightToe};

// Parts of one side.
enum BodyPart : int {
  kHipPart,
  kKneePart,
  kAnklePart,
  kToePart,
  kCollarPart,
  kShoulderPart,
  kElbowPart,
  kWristPart,
  kHandPart,
  kEarPart,
  kBodyPartCount,
};

// Columns; -1 where a skeleton has none.
struct BodyColumns {
  std::array<std::array<int, kBodyPartCount>, 2> side;  // left, right
  int pelvis = -1, neck = -1, head = -1, head_top = -1, nose = -1;
  std::vector<int> trunk;  // between pelvis and neck, from below
};

// A prefix that all names share is ignored (motion/layouts/joint_names.h). Two ways of
// naming are in use: by joints (shoulder, elbow, wrist, hip, knee, ankle), and
// by the bone that begins there (captures: Shoulder = collar, Arm, ForeArm,
// Hand = wrist, UpLeg, Leg, Foot = ankle). Throws InputError where a part is
// there twice; `skeleton` stands in messages.
BodyColumns body_columns(const std::string& skeleton, const std::vector<std::string>& names);

// Throws InputError listing the parts without which nobody can be made.
void require_parts(const BodyColumns& columns, const std::string& skeleton);

// `size`: how many columns. Throws InputError listing the parts that are
// missing.
std::array<JointRecipe, kSmplJoints> recipes_of(const BodyColumns& columns, int size, const std::string& skeleton);

std::vector<JointRecipe::Part> face_of(const BodyColumns& columns);

}  // namespace duet
