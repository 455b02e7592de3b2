// Skeletons that joint positions come in: the names of their columns, and how each SMPL-24 joint is made of them. One
// table of names, one set of rules; a user's own names go the same way. Thread-safe.
#pragma once

#include <array>
#include <string>
#include <string_view>
#include <vector>

#include "duet/core/recording.h"
#include "duet/motion/layouts/joint_recipes.h"

namespace duet {

struct JointLayout {
  std::string name;                // "kinect-15", "coco-17", "smpl-22", "smpl-24", "kinect-25", "optitrack-64", ...
  std::vector<std::string> names;  // of the columns, in the order of the file
  std::array<JointRecipe, kSmplJoints> smpl;
  std::vector<JointRecipe::Part> face = {};  // out of the face: nose from the middle of the ears; empty where unknown
  // A tracker that loses joints writes NaN for them: short gaps are filled (clip_of). Elsewhere NaN is a damaged file.
  bool has_gaps = false;
  int made_up = 0;  // columns at the end of `names` that no file holds: legs that add_legs() makes up

  [[nodiscard]] bool has_toes() const { return smpl[kLeftToe].ahead == 0.0; }
};

// Throws std::invalid_argument for an unknown name and lists the known ones. The result lives as long as the program.
const JointLayout& joint_layout(std::string_view name);
std::vector<std::string> joint_layout_names();

// A skeleton of these columns; names are matched by what they are called elsewhere ("l_wrist", "LeftHand", "WristLeft";
// a prefix up to ':' is ignored), columns of other names are not used. Throws InputError where the names do not make a
// person, with the parts that are missing, or where one part is there twice. With Legs::kMadeUp those of an upper body
// (lacks_legs) become columns at the end.
enum class Legs { kNeeded, kMadeUp };
JointLayout layout_of_names(std::string name, std::vector<std::string> names, Legs legs = Legs::kNeeded);

// A layout's name, or the path of a text file: of names in the order of the
// columns, one a line ('#' begins a comment), or of lines "left_hip: NAME"
// (motion/layouts/joint_recipes.h) for columns that have `own_names`. Throws InputError
// naming the file, or std::invalid_argument for neither.
JointLayout read_joint_layout(const std::string& name_or_path, const std::vector<std::string>& own_names = {},
                              Legs legs = Legs::kNeeded);

// The 24 joints of one frame whose columns are in metres in W (z up). `offsets` false: without reach, ahead and down,
// in any unit and axes.
using SmplFrame = Eigen::Matrix<double, 3, kSmplJoints>;
void make_smpl(const JointLayout& layout, const PointTracks::ConstFrame& columns, bool offsets,
               Eigen::Ref<Eigen::Matrix3Xd> smpl);

// Puts the toe of a foot (0 left, 1 right) ahead of its ankle, in the way that
// people without toes get them.
void put_toe(Eigen::Ref<Eigen::Matrix3Xd> smpl, int side);

}  // namespace duet
