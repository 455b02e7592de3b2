// Which column of a skeleton is which part of the body, by what joints are called in captures, trackers and models; and
// the SMPL-24 joints that follow from the parts. Pure functions.
#pragma once

#include <array>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "duet/core/recording.h"

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

// A prefix that all names share is ignored (motion/layouts/joint_recipes.h). Two ways of
// naming are in use: by joints (shoulder, elbow, wrist, hip, knee, ankle), and
// by the bone that begins there (captures: Shoulder = collar, Arm, ForeArm,
// Hand = wrist, UpLeg, Leg, Foot = ankle). Throws InputError where a part is
// there twice; `skeleton` stands in messages.
BodyColumns body_columns(const std::string& skeleton, const std::vector<std::string>& names);

// Throws InputError listing the parts without which nobody can be made.
void require_parts(const BodyColumns& columns, const std::string& skeleton);

// Whether no column is of a leg below the hips, and both hips or neither are there.
bool lacks_legs(const BodyColumns& columns);

// `size`: how many columns. Throws InputError listing the parts that are
// missing.
std::array<JointRecipe, kSmplJoints> recipes_of(const BodyColumns& columns, int size, const std::string& skeleton);

std::vector<JointRecipe::Part> face_of(const BodyColumns& columns);

// Names of joints as files have them, made alike: without the prefix that all
// of them share, or as a user's own file says. Thread-safe.

// "Actor1.LeftHand", "mixamorig_LeftHand", "Bip01 L Hand", "ns:LeftHand"
// without what stands before the joint: all up to a ':', and the longest
// beginning that ends in one of " _.-|" (or is a whole name) and that four
// fifths of the names share.
std::vector<std::string> without_prefix(const std::vector<std::string>& names);

// The SMPL joint that a name in the file stands for ("left_hip"), by that name.
using JointNameMap = std::map<std::string, std::string>;

// Lines "left_hip: Bone_12" (YAML of one level; '#' begins a comment, quotes
// may surround a name). Nothing where no line has a colon: a list of names.
// Throws InputError naming file and line: a joint that SMPL has not, a name or
// a joint that is there twice.
std::optional<JointNameMap> parse_joint_name_map(std::string_view text, const std::string& file);

// The SMPL joint of each name that the map has, "" of the others. Throws
// InputError where the map names a joint that is not among them; `file`: of the
// names.
std::vector<std::string> mapped(const JointNameMap& map, const std::vector<std::string>& names,
                                const std::string& file);

}  // namespace duet
