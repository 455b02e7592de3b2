// A robot card as written, with what it extends, before it meets the URDF. Format: docs/file-formats.md, "Robot card".
// Names are not yet looked up; every entry keeps its place for later messages.
#pragma once

#include <yaml-cpp/yaml.h>

#include <Eigen/Core>
#include <array>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "duet/core/robot_state.h"
#include "duet/robots/robot_model.h"
#include "duet/robots/urdf.h"
#include "duet/robots/yaml_section.h"

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
  std::map<std::string, std::string> content;  // of every key but `extends` and `urdf`, in one spelling: card.h
};

// Names of tracks that detectors know.
inline constexpr const char* kTrackNames[] = {"head", "lhand", "rhand", "torso", "lshoulder", "rshoulder"};

// The roles of a card: read from it, and looked up in the robot that it makes. docs/file-formats.md, "Robot card".

// Replaces what the keys of `card`, which stands in `file`, say. Throws InputError as YamlSection does.
void read_roles(const YamlSection& card, const std::string& file, CardRoles& roles);

// Sets roles, fall, stance and root_bounds of a robot that has everything else. A joint that the card locks is left
// out. Throws InputError with file and line: unknown names, legs or arms whose sides do not mirror one another joint by
// joint, a joint that is given two sides, an angle or a range outside the joint's limits.
void bind_roles(const RobotCard& card, RobotModel& robot);

// Reads a card and what it extends. Format: docs/file-formats.md, "Robot card".

// Cards that one may extend in a row.
inline constexpr int kMostExtended = 8;

// `file` names the card and is where `extends` starts from; what it extends is read and is a card of its own, whose
// keys stand where the card has none. Throws InputError as YamlSection does, and for a cycle, naming both files.
RobotCard parse_card(const std::string& text, const std::string& file);

// The URDF of a card: beside it, or, where that may not be passed on, where files of others are. Throws MissingError
// where it is nowhere.
std::string urdf_of(const std::string& card_path, const RobotCard& card);

// A sentence on the <dynamics> of the joints that the robot moves, which is not simulated; "" where it has none.
std::string dynamics_note(const RobotModel& robot, const UrdfModel& urdf, const std::string& file);

// Which robot a row was run on. The digest of a robot is of the URDF's bytes and of what its card says with all that it
// extends, in one spelling: comments, the order of keys, the way numbers are written and how keys are spread over files
// do not count. Cards of before that rule had the digest of their own bytes, and published rows carry it: those that
// still say the same keep it.

// Values of a card's keys but `extends` and `urdf`: in one spelling, mappings by key, numbers in the shortest form.
std::map<std::string, std::string> content_of(const YAML::Node& card);

// SHA-256, hex.
std::string robot_digest(std::string_view urdf, const std::map<std::string, std::string>& content);

}  // namespace duet
