// A robot card as written, with what it extends, before it meets the URDF. Format: docs/file-formats.md, "Robot card".
// Names are not yet looked up; every entry keeps its place for later messages.
#pragma once

#include <Eigen/Core>
#include <array>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "duet/core/pose.h"
#include "duet/robots/robot_model.h"

namespace duet {

// Where something stands: the card itself, or one that it extends.
struct CardPlace {
  std::string file;
  int line = 0;
};

struct CardJoint {
  std::string name;
  CardPlace place;
  double armature = 0.0, kp = 0.0, kd = 0.0, neutral = 0.0;
  std::optional<double> lower, upper, effort, velocity;  // override the URDF's
};

struct CardLock {
  std::string joint;
  CardPlace place;
  double position = 0.0;  // [rad] or [m]
};

struct CardFrame {
  std::string name;
  CardPlace place;
  std::string link;  // a link of the URDF
  Pose X_LF;
  bool replaces_urdf_link = false;
};

struct CardShape {
  CardPlace place;
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
  CardPlace place;
  std::string frame;
  int smpl = -1;
};

// Two body regions whose shapes touch one another.
struct CardRegions {
  CardPlace place;
  std::string first, second;
};

// A joint, link or frame that a role names.
struct CardName {
  std::string name;
  CardPlace place;
};

// A number for a joint by name: an angle of a pose.
struct CardAngle {
  CardName joint;
  double value = 0.0;
};

struct CardRange {
  CardName joint;
  double lower = 0.0, upper = 0.0;
};

// Parts by what they are for; those of a side stand left before right.
struct CardRoles {
  std::array<std::vector<CardName>, 2> legs, arms;
  CardPlace legs_place, arms_place;
  std::vector<CardName> waist, wrists, bodies;
  std::vector<std::vector<CardName>> compound;
  std::optional<CardName> push_link, imu;
  std::vector<CardRange> pose_ranges;
  std::map<std::string, std::vector<CardAngle>> poses;
  std::optional<FallRule> fall;
  std::optional<StanceSize> stance;
  std::optional<RootBounds> root_bounds;
};

struct RobotCard {
  std::string name, urdf, base;  // `urdf`: relative to the card's folder, whichever file names it
  CardPlace base_place;
  std::vector<CardJoint> joints;
  std::vector<CardLock> locked;
  std::vector<CardFrame> frames;
  std::vector<CardShape> shapes;
  std::vector<CardPoint> pairs, keypoints, tracks;
  std::vector<CardRegions> self_collision;
  CardRoles roles;
  std::vector<std::string> files;              // the card, what it extends, and so on
  std::map<std::string, std::string> content;  // of every key but `extends` and `urdf`, in one spelling: card_digest.h
};

// Names of tracks that detectors know.
inline constexpr const char* kTrackNames[] = {"head", "lhand", "rhand", "torso", "lshoulder", "rshoulder"};

}  // namespace duet
