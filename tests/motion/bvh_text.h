// BVH files for tests: small skeletons with CMU's or the common joint names, as text.
#pragma once

#include <fmt/format.h>

#include <Eigen/Core>
#include <string>
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

// As LAFAN1 has it: the common names, feet that end in Toe, three vertebrae, no fingers.
inline std::vector<BvhBone> lafan_bones() {
  std::vector<BvhBone> bones = common_bones();
  for (BvhBone& bone : bones) {
    bone.name = bone.name.substr(std::string("mixamorig:").size());
    if (bone.name.ends_with("ToeBase")) bone.name = bone.name.substr(0, bone.name.size() - 4);
  }
  return bones;
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
  // Angles about the file's Z, Y, X that turn as the given ones about Z, Y, X of a y-up file; one at a time is enough.
  [[nodiscard]] std::string angles(const Eigen::Vector3d& zyx) const {
    if (!z_up) return fmt::format("{:.12g} {:.12g} {:.12g} ", zyx[0], zyx[1], zyx[2]);
    return fmt::format("{:.12g} {:.12g} {:.12g} ", zyx[1], -zyx[0], zyx[2]);
  }

  void write_joint(int index, std::string& out) const {
    const BvhBone& bone = bones[index];
    const Eigen::Vector3d offset = turned(bone.offset) / metres_per_unit;
    const bool end = bone.name.ends_with("/end");
    out += end ? "End Site" : (bone.parent < 0 ? "ROOT " : "JOINT ") + bone.name;
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
