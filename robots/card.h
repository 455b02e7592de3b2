// A robot card as written, before it meets the URDF. Format: docs/file-formats.md, "Robot card". Names are not yet
// looked up; every entry keeps its line for later messages.
#pragma once

#include <Eigen/Core>
#include <optional>
#include <string>
#include <vector>

#include "core/pose.h"
#include "robots/robot_model.h"

namespace duet {

struct CardJoint {
  std::string name;
  int line = 0;
  double armature = 0.0, kp = 0.0, kd = 0.0, neutral = 0.0;
  std::optional<double> lower, upper, effort, velocity;  // override the URDF's
};

struct CardLock {
  std::string joint;
  int line = 0;
  double position = 0.0;  // [rad] or [m]
};

struct CardFrame {
  std::string name;
  int line = 0;
  std::string link;  // a link of the URDF
  Pose X_LF;
  bool replaces_urdf_link = false;
};

struct CardShape {
  int line = 0;
  std::string link;
  ShapeKind kind = ShapeKind::kSphere;
  Eigen::Vector3d from = Eigen::Vector3d::Zero();  // a sphere's centre; else a capsule's ends, in the link's frame [m]
  Eigen::Vector3d to = Eigen::Vector3d::Zero();
  double radius = 0.0;
  std::string region;
  bool sole = false;
};

// A pair of A.1.1, a keypoint or a track: a frame by name and, where it has one, the human's joint.
struct CardPoint {
  std::string name;
  int line = 0;
  std::string frame;
  int smpl = -1;
};

// Two body regions whose shapes touch one another.
struct CardRegions {
  int line = 0;
  std::string first, second;
};

struct RobotCard {
  std::string name, urdf, base;
  int base_line = 0;
  std::vector<CardJoint> joints;
  std::vector<CardLock> locked;
  std::vector<CardFrame> frames;
  std::vector<CardShape> shapes;
  std::vector<CardPoint> pairs, keypoints, tracks;
  std::vector<CardRegions> self_collision;
};

// Names of tracks that detectors know.
inline constexpr const char* kTrackNames[] = {"head", "lhand", "rhand", "torso", "lshoulder", "rshoulder"};

// Throws InputError as YamlSection does; `file` names the card.
RobotCard parse_card(const std::string& text, const std::string& file);

}  // namespace duet
