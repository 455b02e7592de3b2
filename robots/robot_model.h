// A robot as the benchmark needs it: a tree of links with one hinge each, from a URDF and a card (YAML). Immutable
// after load; shared between threads. Fixed joints are merged into their parents; every URDF link stays known as a
// frame.
#pragma once

#include <Eigen/Core>
#include <map>
#include <memory>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "core/pose.h"
#include "core/robot_state.h"

namespace duet {

struct RobotLink {
  std::string name;
  int parent = -1;                                    // index in links; -1 for the base
  Pose X_PL;                                          // pose in the parent at q = 0
  Eigen::Vector3d axis = Eigen::Vector3d::UnitZ();    // of the hinge that moves it, in L, unit (base: unused)
  double mass = 0.0;                                  // [kg]
  Eigen::Vector3d com = Eigen::Vector3d::Zero();      // p_LCom [m]
  Eigen::Matrix3d inertia = Eigen::Matrix3d::Zero();  // about the centre of mass, axes of L [kg m^2]
};

struct RobotJoint {
  std::string name;
  double lower = 0.0, upper = 0.0;  // [rad]
  double effort = 0.0;              // [N m]
  double velocity = 0.0;            // [rad/s]
  double armature = 0.0;            // [kg m^2]
  double kp = 0.0, kd = 0.0;        // the card's default gains [N m/rad], [N m s/rad]
};

// Any named frame: a URDF link (merged or not) or a virtual one of the card (head_link, left_hand_link, ...).
struct RobotFrame {
  std::string name;
  int link = 0;
  Pose X_LF;
};

enum class ShapeKind { kSphere, kCapsule };

// Collision shape on a link. A capsule lies along z of its frame, `half_length` to either side of the origin (without
// caps).
struct RobotShape {
  ShapeKind kind = ShapeKind::kSphere;
  int link = 0;
  Pose X_LS;
  double radius = 0.0;       // [m]
  double half_length = 0.0;  // [m], 0 for a sphere
  std::string region;        // body region of the card ("foot", "hand", "torso", ...)
};

// One of the robot-SMPL pairs of A.1.1.
struct RetargetPair {
  int frame = 0;  // in RobotModel::frames
  int smpl = 0;   // SMPL-24 joint
};

// One interaction keypoint (head, shoulders, elbows, wrists, hands): frame of the robot, joint of the human.
struct Keypoint {
  std::string name;
  int frame = 0;
  int smpl = 0;
};

struct RobotModel {
  std::string name;
  std::vector<RobotLink> links;    // links[0] is the base; links[i] is moved by joints[i - 1]; parents come first
  std::vector<RobotJoint> joints;  // in the card's order
  std::vector<RobotFrame> frames;
  std::vector<RobotShape> shapes;
  std::vector<RetargetPair> pairs;    // the 16 of A.1.1, in its order
  std::vector<Keypoint> keypoints;    // card order: head, shoulders, elbows, wrists, hands; left before right
  std::map<std::string, int> tracks;  // frames that detectors follow: "head", "lhand", "rhand", "torso", "lshoulder",
                                      // "rshoulder" (those that the card names)
  // Pairs of shapes that may touch: those of the card's pairs of regions whose links more than three joints join. Each
  // once, the lower index first, in ascending order.
  std::vector<std::pair<int, int>> self_collision;
  std::vector<int> feet;         // shapes that are the soles' contact sites (left foot's first)
  Eigen::VectorXd neutral;       // neutral pose of A.4.4 with the standing legs [rad]
  double standing_height = 0.0;  // of the base over flat ground in the neutral pose [m]; 0 where no shape is a sole
  std::string digest;            // SHA-256 over URDF and card

  [[nodiscard]] int dof() const { return static_cast<int>(joints.size()); }
  [[nodiscard]] std::vector<std::string> joint_names() const;
  [[nodiscard]] Eigen::VectorXd lower() const;
  [[nodiscard]] Eigen::VectorXd upper() const;
  // Indices by name; throw std::invalid_argument with the nearest and all known names.
  [[nodiscard]] int joint_index(std::string_view name) const;
  [[nodiscard]] int frame_index(std::string_view name) const;
  [[nodiscard]] int keypoint_index(std::string_view name) const;
  [[nodiscard]] int track_frame(std::string_view name) const;  // index in frames of one of `tracks`
  [[nodiscard]] double total_mass() const;
  // Standing in the neutral pose at `X_WB`'s x, y and yaw, at rest, soles on the ground z = 0.
  [[nodiscard]] RobotState standing_state(const Pose& X_WB = {}) const;
  // The card's gains around a target.
  [[nodiscard]] JointCommand default_command(const Eigen::VectorXd& q_target) const;
};

// Loads a card and the URDF it names (relative to the card; `urdf_path`, where given, replaces it). Meshes need not
// exist. Throws InputError naming file, element, expected and found: no or a broken URDF, a cycle or two roots, a joint
// that is neither revolute nor fixed (continuous is taken as +-2 pi), a joint of the card that the URDF lacks or the
// other way round, unknown keys of the card, values that are not finite or out of range (mass <= 0, lower > upper,
// ...).
RobotModel load_robot(const std::string& card_path, const std::string& urdf_path = "");

// The card that ships with duet: robots/g1/g1.yaml in the source tree or $DUET_SHARE/robots/g1/g1.yaml or beside the
// program. Throws MissingError naming the places looked at.
std::string default_card_path();
// The same of another card that ships with duet, by its name without the ending ("g1_27dof").
std::string card_path(const std::string& name);

// The robot of a card, or where the path is empty of the one that ships with duet, to be shared by episodes and
// threads.
std::shared_ptr<const RobotModel> load_shared_robot(const std::string& card_path = "");

}  // namespace duet
