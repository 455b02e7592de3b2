// BVH files for tests: small skeletons with CMU's or the common joint names, as text.
#pragma once

#include <fmt/format.h>

#include <Eigen/Core>
#include <map>
#include <string>
#include <utility>
#include <vector>

namespace duet::test {

struct BvhBone {
  std::string name;  // "X/end" is written as the End Site of X
  int parent = -1;
  Eigen::Vector3d offset;  // [m], y up, facing +z
};

// T pose of a person of 1.7 m. Both have their root 0.93 m above the soles.
inline std::vector<BvhBone> cmu_bones() {
  return {{"Hips", -1, {0, 0, 0}},
          {"LHipJoint", 0, {0, 0, 0}},
          {"LeftUpLeg", 1, {0.09, -0.07, 0}},
          {"LeftLeg", 2, {0, -0.4, 0}},
          {"LeftFoot", 3, {0, -0.4, 0}},
          {"LeftToeBase", 4, {0, -0.04, 0.12}},
          {"LeftToeBase/end", 5, {0, 0, 0.06}},
          {"RHipJoint", 0, {0, 0, 0}},
          {"RightUpLeg", 7, {-0.09, -0.07, 0}},
          {"RightLeg", 8, {0, -0.4, 0}},
          {"RightFoot", 9, {0, -0.4, 0}},
          {"RightToeBase", 10, {0, -0.04, 0.12}},
          {"RightToeBase/end", 11, {0, 0, 0.06}},
          {"LowerBack", 0, {0, 0, 0}},
          {"Spine", 13, {0, 0.14, 0}},
          {"Spine1", 14, {0, 0.17, 0}},
          {"Neck", 15, {0, 0, 0}},
          {"Neck1", 16, {0, 0.18, 0}},
          {"Head", 17, {0, 0.06, 0}},
          {"Head/end", 18, {0, 0.06, 0}},
          {"LeftShoulder", 15, {0, 0, 0}},
          {"LeftArm", 20, {0.18, 0.13, 0}},
          {"LeftForeArm", 21, {0.28, 0, 0}},
          {"LeftHand", 22, {0.25, 0, 0}},
          {"LeftFingerBase", 23, {0, 0, 0}},
          {"LeftHandIndex1", 24, {0.05, 0, 0}},
          {"LeftHandIndex1/end", 25, {0.04, 0, 0}},
          {"LThumb", 23, {0, 0, 0}},
          {"RightShoulder", 15, {0, 0, 0}},
          {"RightArm", 28, {-0.18, 0.13, 0}},
          {"RightForeArm", 29, {-0.28, 0, 0}},
          {"RightHand", 30, {-0.25, 0, 0}},
          {"RightFingerBase", 31, {0, 0, 0}},
          {"RightHandIndex1", 32, {-0.05, 0, 0}},
          {"RightHandIndex1/end", 33, {-0.04, 0, 0}},
          {"RThumb", 31, {0, 0, 0}}};
}

inline std::vector<BvhBone> common_bones() {
  return {{"mixamorig:Hips", -1, {0, 0, 0}},
          {"mixamorig:Spine", 0, {0, 0.1, 0}},
          {"mixamorig:Spine1", 1, {0, 0.12, 0}},
          {"mixamorig:Spine2", 2, {0, 0.12, 0}},
          {"mixamorig:Neck", 3, {0, 0.18, 0}},
          {"mixamorig:Head", 4, {0, 0.1, 0}},
          {"mixamorig:LeftShoulder", 3, {0.06, 0.1, 0}},
          {"mixamorig:LeftArm", 6, {0.12, 0, 0}},
          {"mixamorig:LeftForeArm", 7, {0.28, 0, 0}},
          {"mixamorig:LeftHand", 8, {0.25, 0, 0}},
          {"mixamorig:LeftHand/end", 9, {0.09, 0, 0}},
          {"mixamorig:RightShoulder", 3, {-0.06, 0.1, 0}},
          {"mixamorig:RightArm", 11, {-0.12, 0, 0}},
          {"mixamorig:RightForeArm", 12, {-0.28, 0, 0}},
          {"mixamorig:RightHand", 13, {-0.25, 0, 0}},
          {"mixamorig:RightHand/end", 14, {-0.09, 0, 0}},
          {"mixamorig:LeftUpLeg", 0, {0.09, -0.07, 0}},
          {"mixamorig:LeftLeg", 16, {0, -0.4, 0}},
          {"mixamorig:LeftFoot", 17, {0, -0.4, 0}},
          {"mixamorig:LeftToeBase", 18, {0, -0.04, 0.12}},
          {"mixamorig:RightUpLeg", 0, {-0.09, -0.07, 0}},
          {"mixamorig:RightLeg", 20, {0, -0.4, 0}},
          {"mixamorig:RightFoot", 21, {0, -0.4, 0}},
          {"mixamorig:RightToeBase", 22, {0, -0.04, 0.12}}};
}

// As Xsens MVN exports it: joints by their anatomy, the vertebrae Chest to Chest4.
inline std::vector<BvhBone> xsens_bones() {
  std::vector<BvhBone> bones = {{"Hips", -1, {0, 0, 0}},     {"Chest", 0, {0, 0.10, 0}},   {"Chest2", 1, {0, 0.08, 0}},
                                {"Chest3", 2, {0, 0.08, 0}}, {"Chest4", 3, {0, 0.08, 0}},  {"Neck", 4, {0, 0.18, 0}},
                                {"Head", 5, {0, 0.10, 0}},   {"Head/end", 6, {0, 0.15, 0}}};
  for (const double side : {1.0, -1.0}) {
    const std::string name = side > 0.0 ? "Left" : "Right";
    const int first = static_cast<int>(bones.size());
    bones.push_back({name + "Collar", 4, {0.06 * side, 0.1, 0}});
    bones.push_back({name + "Shoulder", first, {0.12 * side, 0, 0}});
    bones.push_back({name + "Elbow", first + 1, {0.28 * side, 0, 0}});
    bones.push_back({name + "Wrist", first + 2, {0.25 * side, 0, 0}});
    bones.push_back({name + "Wrist/end", first + 3, {0.09 * side, 0, 0}});
    bones.push_back({name + "Hip", 0, {0.09 * side, -0.07, 0}});
    bones.push_back({name + "Knee", first + 5, {0, -0.4, 0}});
    bones.push_back({name + "Ankle", first + 6, {0, -0.4, 0}});
    bones.push_back({name + "Toe", first + 7, {0, -0.04, 0.12}});
  }
  return bones;
}

// As SOMA's skeleton has it: Leg is the thigh, Shin the lower leg.
inline std::vector<BvhBone> soma_bones() {
  std::vector<BvhBone> bones = {{"Hips", -1, {0, 0, 0}},    {"Spine1", 0, {0, 0.10, 0}}, {"Spine2", 1, {0, 0.12, 0}},
                                {"Chest", 2, {0, 0.12, 0}}, {"Neck1", 3, {0, 0.18, 0}},  {"Neck2", 4, {0, 0.05, 0}},
                                {"Head", 5, {0, 0.05, 0}}};
  for (const double side : {1.0, -1.0}) {
    const std::string name = side > 0.0 ? "Left" : "Right";
    const int first = static_cast<int>(bones.size());
    bones.push_back({name + "Shoulder", 3, {0.06 * side, 0.1, 0}});
    bones.push_back({name + "Arm", first, {0.12 * side, 0, 0}});
    bones.push_back({name + "ForeArm", first + 1, {0.28 * side, 0, 0}});
    bones.push_back({name + "Hand", first + 2, {0.25 * side, 0, 0}});
    bones.push_back({name + "HandMiddle1", first + 3, {0.09 * side, 0, 0}});
    bones.push_back({name + "Leg", 0, {0.09 * side, -0.07, 0}});
    bones.push_back({name + "Shin", first + 5, {0, -0.4, 0}});
    bones.push_back({name + "Foot", first + 6, {0, -0.4, 0}});
    bones.push_back({name + "ToeBase", first + 7, {0, -0.04, 0.12}});
  }
  return bones;
}

// As LAFAN1 has it: the common names, feet that end in Toe, three vertebrae, no fingers, and End Sites of no length: a
// hand and a toe end where they begin.
inline std::vector<BvhBone> lafan_bones() {
  std::vector<BvhBone> bones = common_bones();
  for (BvhBone& bone : bones) {
    bone.name = bone.name.substr(std::string("mixamorig:").size());
    if (bone.name.ends_with("ToeBase")) bone.name = bone.name.substr(0, bone.name.size() - 4);
    if (bone.name.ends_with("/end")) bone.offset.setZero();
  }
  for (const char* toe : {"LeftToe", "RightToe"})
    for (int j = static_cast<int>(bones.size()); j-- > 0;)
      if (bones[j].name == toe) bones.push_back({std::string(toe) + "/end", j, {0, 0, 0}});
  return bones;
}

// Names that others give to the joints of lafan_bones(), "@" for the side.
struct BvhNames {
  std::string maker, left, right;
  std::string hips, spine, spine1, spine2, neck, head, collar, shoulder, elbow, wrist, hip, knee, ankle, toe;

  [[nodiscard]] std::map<std::string, std::string> map() const {
    std::map<std::string, std::string> names = {{"Hips", hips},     {"Spine", spine}, {"Spine1", spine1},
                                                {"Spine2", spine2}, {"Neck", neck},   {"Head", head}};
    for (const bool is_left : {true, false})
      for (const auto& [common, name] : {std::pair{"Shoulder", &collar},
                                         {"Arm", &shoulder},
                                         {"ForeArm", &elbow},
                                         {"Hand", &wrist},
                                         {"UpLeg", &hip},
                                         {"Leg", &knee},
                                         {"Foot", &ankle},
                                         {"Toe", &toe}}) {
        std::string sided = *name;
        sided.replace(sided.find('@'), 1, is_left ? left : right);
        names[(is_left ? "Left" : "Right") + std::string(common)] = sided;
      }
    return names;
  }
};

inline std::vector<BvhNames> bvh_names_of_others() {
  return {
      {"Biped", "L", "R", "Bip01 Pelvis", "Bip01 Spine", "Bip01 Spine1", "Bip01 Spine2", "Bip01 Neck", "Bip01 Head",
       "Bip01 @ Clavicle", "Bip01 @ UpperArm", "Bip01 @ Forearm", "Bip01 @ Hand", "Bip01 @ Thigh", "Bip01 @ Calf",
       "Bip01 @ Foot", "Bip01 @ Toe0"},
      {"Bandai-Namco", "L", "R", "Hips", "Spine", "Spine1", "Chest", "Neck", "Head", "Shoulder_@", "UpperArm_@",
       "LowerArm_@", "Hand_@", "UpperLeg_@", "LowerLeg_@", "Foot_@", "Toes_@"},
      {"Rokoko", "Left", "Right", "Hips", "Spine1", "Spine2", "Spine3", "Neck", "Head", "@Shoulder", "@Arm", "@ForeArm",
       "@Hand", "@Thigh", "@Shin", "@Foot", "@Toe"},
      {"SMPL", "L", "R", "Pelvis", "Spine1", "Spine2", "Spine3", "Neck", "Head", "@_Collar", "@_Shoulder", "@_Elbow",
       "@_Wrist", "@_Hip", "@_Knee", "@_Ankle", "@_Foot"},
      {"Unity", "Left", "Right", "Hips", "Spine", "Chest", "UpperChest", "Neck", "Head", "@Shoulder", "@UpperArm",
       "@LowerArm", "@Hand", "@UpperLeg", "@LowerLeg", "@Foot", "@Toes"},
      {"lower case", "left", "right", "hips", "spine", "spine1", "spine2", "neck", "head", "@shoulder", "@arm",
       "@forearm", "@hand", "@upleg", "@leg", "@foot", "@toebase"},
      {"Vicon", "Left", "Right", "Actor1.Hips", "Actor1.Spine", "Actor1.Spine1", "Actor1.Spine2", "Actor1.Neck",
       "Actor1.Head", "Actor1.@Shoulder", "Actor1.@Arm", "Actor1.@ForeArm", "Actor1.@Hand", "Actor1.@UpLeg",
       "Actor1.@Leg", "Actor1.@Foot", "Actor1.@Toe"},
      {"MotionBuilder", "Left", "Right", "Character1_Hips", "Character1_Spine", "Character1_Spine1",
       "Character1_Spine2", "Character1_Neck", "Character1_Head", "Character1_@Shoulder", "Character1_@Arm",
       "Character1_@ForeArm", "Character1_@Hand", "Character1_@UpLeg", "Character1_@Leg", "Character1_@Foot",
       "Character1_@Toe"},
      {"Mixamo without a colon", "Left", "Right", "mixamorig_Hips", "mixamorig_Spine", "mixamorig_Spine1",
       "mixamorig_Spine2", "mixamorig_Neck", "mixamorig_Head", "mixamorig_@Shoulder", "mixamorig_@Arm",
       "mixamorig_@ForeArm", "mixamorig_@Hand", "mixamorig_@UpLeg", "mixamorig_@Leg", "mixamorig_@Foot",
       "mixamorig_@ToeBase"},
      {"Mixamo with a number", "Left", "Right", "mixamorig1:Hips", "mixamorig1:Spine", "mixamorig1:Spine1",
       "mixamorig1:Spine2", "mixamorig1:Neck", "mixamorig1:Head", "mixamorig1:@Shoulder", "mixamorig1:@Arm",
       "mixamorig1:@ForeArm", "mixamorig1:@Hand", "mixamorig1:@UpLeg", "mixamorig1:@Leg", "mixamorig1:@Foot",
       "mixamorig1:@ToeBase"},
      {"video", "left", "right", "character_A_hips", "character_A_spine", "character_A_spine1", "character_A_spine2",
       "character_A_neck", "character_A_head", "character_A_@_collar", "character_A_@_shoulder", "character_A_@_elbow",
       "character_A_@_wrist", "character_A_@_hip", "character_A_@_knee", "character_A_@_ankle", "character_A_@_foot"},
      {"Xsens by segments", "Left", "Right", "Pelvis", "L5", "L3", "T8", "Neck", "Head", "@Shoulder", "@UpperArm",
       "@ForeArm", "@Hand", "@UpperLeg", "@LowerLeg", "@Foot", "@Toe"},
      {"Rigify", "L", "R", "DEF-hips", "DEF-spine", "DEF-spine.001", "DEF-spine.002", "DEF-neck", "DEF-head",
       "DEF-shoulder.@", "DEF-upper_arm.@", "DEF-forearm.@", "DEF-hand.@", "DEF-thigh.@", "DEF-shin.@", "DEF-foot.@",
       "DEF-toe.@"},
      {"DAZ", "l", "r", "hip", "abdomen", "chest", "chest2", "neck", "head", "@Collar", "@Shldr", "@ForeArm", "@Hand",
       "@Thigh", "@Shin", "@Foot", "@Toe"},
      {"ASF", "l", "r", "root", "lowerback", "upperback", "chest", "lowerneck", "head", "@clavicle", "@humerus",
       "@radius", "@wrist", "@femur", "@tibia", "@foot", "@toes"},
  };
}

struct BvhWriter {
  std::vector<BvhBone> bones = cmu_bones();
  double metres_per_unit = 0.01;
  bool z_up = false;
  std::string frame_time = "0.02";
  Eigen::Vector3d root = {0, 0.93, 0};       // position in frame 0 [m], y up
  Eigen::Vector3d velocity = {0, 0, 0};      // per frame [m]
  Eigen::Vector3d first_angles = {0, 0, 0};  // Z, Y, X of the root [deg], y up
  double arm_drop = 75.0;                    // of the arms below horizontal from frame `t_pose` on [deg]
  bool t_pose = false;                       // frame 0 has the arms out
  double swing = 3.0;                        // of the left thigh, per frame [deg]
  int frames = 6;
  std::map<std::string, std::string> names = {};  // what other makers call the bones

  // Axes of a file that is z up: (x, y, z) -> (x, -z, y).
  [[nodiscard]] Eigen::Vector3d turned(const Eigen::Vector3d& v) const {
    return z_up ? Eigen::Vector3d(v.x(), -v.z(), v.y()) : v;
  }

  [[nodiscard]] std::string text() const {
    std::string out = "HIERARCHY\n";
    write_joint(0, out);
    out += fmt::format("MOTION\nFrames: {}\nFrame Time: {}\n", frames, frame_time);
    for (int t = 0; t < frames; ++t) out += frame(t) + "\n";
    return out;
  }

  [[nodiscard]] std::string frame(int t) const {
    std::string out;
    for (const BvhBone& bone : bones) {
      if (bone.name.ends_with("/end")) continue;
      if (bone.parent < 0) {
        const Eigen::Vector3d p = turned(root + t * velocity) / metres_per_unit;
        out += fmt::format("{:.12g} {:.12g} {:.12g} ", p.x(), p.y(), p.z());
        out += angles(first_angles);
      } else if (bone.name.ends_with("Arm") && !bone.name.ends_with("ForeArm")) {
        const double drop = t_pose && t == 0 ? 0.0 : arm_drop;
        out += angles({bone.name.ends_with("LeftArm") ? -drop : drop, 0, 0});
      } else if (bone.name.ends_with("LeftUpLeg")) {
        out += angles({0, 0, swing * (t_pose && t == 0 ? 0 : t)});
      } else {
        out += "0 0 0 ";
      }
    }
    return out;
  }

 private:
  [[nodiscard]] std::string name_of(const BvhBone& bone) const {
    const auto found = names.find(bone.name);
    return found == names.end() ? bone.name : found->second;
  }

  // Angles about the file's Z, Y, X that turn as the given ones about Z, Y, X of a y-up file; one at a time is enough.
  [[nodiscard]] std::string angles(const Eigen::Vector3d& zyx) const {
    if (!z_up) return fmt::format("{:.12g} {:.12g} {:.12g} ", zyx[0], zyx[1], zyx[2]);
    return fmt::format("{:.12g} {:.12g} {:.12g} ", zyx[1], -zyx[0], zyx[2]);
  }

  void write_joint(int index, std::string& out) const {
    const BvhBone& bone = bones[index];
    const Eigen::Vector3d offset = turned(bone.offset) / metres_per_unit;
    const bool end = bone.name.ends_with("/end");
    out += end ? "End Site" : (bone.parent < 0 ? "ROOT " : "JOINT ") + name_of(bone);
    out += fmt::format("\n{{\nOFFSET {:.12g} {:.12g} {:.12g}\n", offset.x(), offset.y(), offset.z());
    if (!end)
      out += bone.parent < 0 ? "CHANNELS 6 Xposition Yposition Zposition Zrotation Yrotation Xrotation\n"
                             : "CHANNELS 3 Zrotation Yrotation Xrotation\n";
    for (std::size_t child = 0; child < bones.size(); ++child)
      if (bones[child].parent == index) write_joint(static_cast<int>(child), out);
    out += "}\n";
  }
};

}  // namespace duet::test
