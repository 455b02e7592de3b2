#include "duet/motion/layouts/joint_layout.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <filesystem>

#include "duet/core/file.h"
#include "duet/core/named_table.h"
#include "duet/core/names.h"
#include "duet/core/require.h"
#include "duet/motion/layouts/joint_recipes.h"

namespace duet {
namespace {

using Names = std::vector<std::string>;

Names with_fingers(Names names, const std::string& side, const Names& fingers, const Names& knuckles) {
  for (const std::string& finger : fingers)
    for (const std::string& knuckle : knuckles) names.push_back(side + finger + knuckle);
  return names;
}

Names smpl_names(int count) { return {kSmplNames.begin(), kSmplNames.begin() + count}; }

// SMPL-X: 22 of the body, face, 2 x 15 of the fingers; then 72 points of the skin.
Names smplx_names() {
  Names names = smpl_names(22);
  for (const char* name : {"jaw", "left_eye", "right_eye"}) names.emplace_back(name);
  for (const std::string side : {"left_", "right_"})
    names = with_fingers(std::move(names), side, {"index", "middle", "pinky", "ring", "thumb"}, {"1", "2", "3"});
  for (int k = 0; k < 72; ++k) names.push_back(fmt::format("skin_{}", k));
  return names;
}

// Motive's skeleton as Inter-X stores it, the ends of chains ("Nub") included.
Names optitrack_names() {
  Names names = {"Hips"};
  for (const std::string side : {"Right", "Left"})
    for (const char* part : {"UpLeg", "Leg", "Foot", "ToeBase", "ToeBase_Nub"}) names.push_back(side + part);
  names.insert(names.end(), {"Spine", "Spine_1"});
  for (const std::string side : {"Right", "Left"}) {
    for (const char* part : {"Shoulder", "Arm", "ForeArm", "Hand"}) names.push_back(side + part);
    names = with_fingers(std::move(names), side + "Hand", {"Pinky", "Ring", "Middle", "Index", "Thumb"},
                         {"1", "2", "3", "3_Nub"});
  }
  names.insert(names.end(), {"Neck", "Head", "Head_Nub"});
  return names;
}

Names kinect_25_names() {
  return {"SpineBase",   "SpineMid",      "Neck",         "Head",       "ShoulderLeft", "ElbowLeft", "WristLeft",
          "HandLeft",    "ShoulderRight", "ElbowRight",   "WristRight", "HandRight",    "HipLeft",   "KneeLeft",
          "AnkleLeft",   "FootLeft",      "HipRight",     "KneeRight",  "AnkleRight",   "FootRight", "SpineShoulder",
          "HandTipLeft", "ThumbLeft",     "HandTipRight", "ThumbRight"};
}

struct Row {
  const char* name;
  Names names;
  bool has_gaps;
};

std::vector<Row> rows() {
  return {
      {"kinect-15",
       {"head", "neck", "torso", "lshoulder", "lelbow", "lhand", "rshoulder", "relbow", "rhand", "lhip", "lknee",
        "lfoot", "rhip", "rknee", "rfoot"},
       true},
      {"kinect-20",
       {"HipCenter", "Spine",         "ShoulderCenter", "Head",       "ShoulderLeft", "ElbowLeft", "WristLeft",
        "HandLeft",  "ShoulderRight", "ElbowRight",     "WristRight", "HandRight",    "HipLeft",   "KneeLeft",
        "AnkleLeft", "FootLeft",      "HipRight",       "KneeRight",  "AnkleRight",   "FootRight"},
       true},
      {"kinect-25", kinect_25_names(), true},
      {"ntu-25", kinect_25_names(), true},
      {"coco-17",
       {"nose", "left_eye", "right_eye", "left_ear", "right_ear", "left_shoulder", "right_shoulder", "left_elbow",
        "right_elbow", "left_wrist", "right_wrist", "left_hip", "right_hip", "left_knee", "right_knee", "left_ankle",
        "right_ankle"},
       true},
      {"smpl-22", smpl_names(22), false},
      {"smpl-24", smpl_names(24), false},
      {"smplx-127", smplx_names(), false},
      {"optitrack-64", optitrack_names(), true},
      // Human3.6M's 17, then two points a foot and two a hand.
      {"imar-25",
       {"pelvis",         "right_hip",   "right_knee",   "right_ankle",  "left_hip",      "left_knee",   "left_ankle",
        "spine",          "thorax",      "face",         "head_top",     "left_shoulder", "left_elbow",  "left_wrist",
        "right_shoulder", "right_elbow", "right_wrist",  "right_foot_a", "right_foot_b",  "left_foot_a", "left_foot_b",
        "left_hand_a",    "left_hand_b", "right_hand_a", "right_hand_b"},
       true},
  };
}

// Which of IMAR's two points of a foot or a hand is which, the data set does not say: what lies between them serves.
void use_pairs(JointLayout& layout) {
  const auto at = [&](const std::string& name) {
    return static_cast<int>(std::find(layout.names.begin(), layout.names.end(), name) - layout.names.begin());
  };
  for (const std::string side : {"left_", "right_"}) {
    const bool left = side == "left_";
    layout.smpl[left ? kLeftToe : kRightToe] = {.parts = {{at(side + "foot_a"), 0.5}, {at(side + "foot_b"), 0.5}}};
    layout.smpl[left ? kLeftHand : kRightHand].toward = {
        {at(side + "hand_a"), 0.5}, {at(side + "hand_b"), 0.5}, {at(side + "wrist"), -1.0}};
  }
}

const std::vector<JointLayout>& layouts() {
  static const std::vector<JointLayout> table = [] {
    std::vector<JointLayout> made;
    for (Row& row : rows()) {
      made.push_back(layout_of_names(row.name, std::move(row.names)));
      made.back().has_gaps = row.has_gaps;
      if (made.back().name == "imar-25") use_pairs(made.back());
    }
    return made;
  }();
  return table;
}

// A tracker's elbow may come as near to its hand as a hand is long: what lies between them stays between them.
constexpr double kMostOfTheWay = 0.4;

Eigen::Vector3d sum(const std::vector<JointRecipe::Part>& parts, const PointTracks::ConstFrame& columns,
                    const Eigen::Ref<Eigen::Matrix3Xd>& smpl) {
  Eigen::Vector3d p = Eigen::Vector3d::Zero();
  const auto size = static_cast<int>(columns.cols());
  for (const JointRecipe::Part& part : parts)
    p += part.weight * (part.column < size ? Eigen::Vector3d(columns.col(part.column))
                                           : Eigen::Vector3d(smpl.col(part.column - size)));
  return p;
}

// The level direction that hips and shoulders face.
Eigen::Vector3d ahead_of(const Eigen::Ref<const Eigen::Matrix3Xd>& smpl) {
  const Eigen::Vector3d left =
      smpl.col(kLeftHip) - smpl.col(kRightHip) + smpl.col(kLeftShoulder) - smpl.col(kRightShoulder);
  return Eigen::Vector3d(left.y(), -left.x(), 0.0).normalized();
}

Eigen::Vector3d offset(const JointRecipe& recipe, const PointTracks::ConstFrame& columns,
                       const Eigen::Ref<Eigen::Matrix3Xd>& smpl) {
  Eigen::Vector3d moved = Eigen::Vector3d::Zero();
  if (recipe.reach != 0.0) {
    const Eigen::Vector3d way = sum(recipe.toward, columns, smpl);
    const double length = way.norm();
    if (length > 0.0) moved += std::min(recipe.reach, kMostOfTheWay * length) / length * way;
  }
  if (recipe.ahead == 0.0 && recipe.down == 0.0) return moved;
  moved += recipe.ahead * ahead_of(smpl);
  moved.z() -= recipe.down;
  return moved;
}

}  // namespace

const JointLayout& joint_layout(std::string_view name) { return entry_named(layouts(), "skeleton", name); }

std::vector<std::string> joint_layout_names() { return names_of(layouts()); }

JointLayout layout_of_names(std::string name, std::vector<std::string> names, Legs legs) {
  BodyColumns columns = body_columns(name, names);
  const std::size_t in_file = names.size();
  if (legs == Legs::kMadeUp && lacks_legs(columns)) {
    for (const int side : {0, 1})
      for (const auto& [part, joint] :
           {std::pair{kHipPart, kLeftHip}, {kKneePart, kLeftKnee}, {kAnklePart, kLeftAnkle}}) {
        if (columns.side[side][part] >= 0) continue;
        columns.side[side][part] = static_cast<int>(names.size());
        names.emplace_back(kSmplNames[side == 0 ? joint : kSmplMirror[joint]]);
      }
  }
  JointLayout layout{.name = std::move(name), .names = std::move(names), .smpl = {}};
  layout.made_up = static_cast<int>(layout.names.size() - in_file);
  layout.smpl = recipes_of(columns, static_cast<int>(layout.names.size()), layout.name);
  layout.face = face_of(columns);
  return layout;
}

JointLayout read_joint_layout(const std::string& name_or_path, const std::vector<std::string>& own_names, Legs legs) {
  const std::vector<std::string> known = joint_layout_names();
  if (std::find(known.begin(), known.end(), name_or_path) != known.end()) return joint_layout(name_or_path);
  if (!std::filesystem::is_regular_file(name_or_path))
    throw std::invalid_argument(unknown_name_message("skeleton", name_or_path, known) +
                                "; or the path of a file of names, one a line");
  const std::string text = read_plain_text(name_or_path);
  std::vector<std::string> names;
  if (const auto map = parse_joint_name_map(text, name_or_path)) {
    if (own_names.empty())
      throw InputError(
          fmt::format("'{}': it says which name stands for which joint, and "
                      "the motion's file has no names; "
                      "expected one name a line, in the order of the columns",
                      name_or_path));
    names = mapped(*map, own_names, name_or_path);
  } else {
    for (std::string_view line : split(text, '\n'))
      if (line = trimmed(line.substr(0, line.find('#')), " \t\r,;\""); !line.empty()) names.emplace_back(line);
  }
  JointLayout layout = layout_of_names(name_or_path, std::move(names), legs);
  layout.has_gaps = true;  // a user's own tracker may lose joints
  return layout;
}

void put_toe(Eigen::Ref<Eigen::Matrix3Xd> smpl, int side) {
  const Eigen::Vector3d way = kToeAhead * ahead_of(smpl) - kToeBelow * Eigen::Vector3d::UnitZ();
  smpl.col(side == 0 ? kLeftToe : kRightToe) = smpl.col(side == 0 ? kLeftAnkle : kRightAnkle) + way;
}

void make_smpl(const JointLayout& layout, const PointTracks::ConstFrame& columns, bool offsets,
               Eigen::Ref<Eigen::Matrix3Xd> smpl) {
  for (const SmplJoint joint : kRecipeOrder) {
    const JointRecipe& recipe = layout.smpl[joint];
    if (recipe.parts.size() == 1 && recipe.parts[0].column < columns.cols())
      smpl.col(joint) = columns.col(recipe.parts[0].column);
    else
      smpl.col(joint) = sum(recipe.parts, columns, smpl);
    if (offsets && (recipe.reach != 0.0 || recipe.ahead != 0.0 || recipe.down != 0.0))
      smpl.col(joint) += offset(recipe, columns, smpl);
  }
}

}  // namespace duet
