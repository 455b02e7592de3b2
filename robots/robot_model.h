// A robot as the benchmark needs it: a tree of links with one hinge each, from a URDF and a card (YAML). Immutable
// after load; shared between threads. Fixed joints are merged into their parents; every URDF link stays known as a
// frame.
#pragma once

#include <Eigen/Core>
#include <array>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "duet/core/robot_state.h"

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

// When a robot counts as fallen: its base is lower than `height`, or its z axis leans further than `cos_tilt` says.
struct FallRule {
  double height = 0.0;  // of the base over the ground [m]
  double cos_tilt = 0.7;
};

[[nodiscard]] bool has_fallen(const RobotState& state, const FallRule& rule);

// Sizes of the stance of a robot that walks or balances.
struct StanceSize {
  double half_width = 0.0;                          // from the middle to the ankle of a standing foot [m]
  Eigen::Vector2d shift = Eigen::Vector2d::Zero();  // that the base may move over standing feet, along x and y [m]
};

// Range of the base's pose that the legs can carry, of a robot that walks.
struct RootBounds {
  double lowest = 0.0, highest = 0.0;  // [m]
  double least_crouch = 0.0;           // lowest height that training asks for [m]
  double max_roll = 0.0;               // [rad]
  double min_pitch = 0.0, max_pitch = 0.0;
};

// The roles of a robot's parts: the card's, so that nothing else has to know a joint's or a link's name. Joints are
// indices in RobotModel::joints, links in RobotModel::links, left before right. Empty where the card names none.
struct RobotRoles {
  std::array<std::vector<int>, 2> legs, arms;  // joints from the trunk outwards
  std::vector<int> waist;                      // joints between pelvis and trunk, whichever of the two is the base
  std::vector<int> wrists;                     // joints
  std::vector<std::vector<int>> compound;      // hinges that together are one joint of a person
  std::vector<int> counterpart;                // of each joint: the one on the other side, or the joint itself
  std::vector<int> bodies;                     // links, one for each part of the body, ascending
  int push_frame = 0;                          // frame where pushes act that name no link
  int imu_frame = 0;                           // frame of the gyro and the accelerometer
  std::map<int, std::pair<double, double>> pose_ranges;  // of joints: where random poses draw them from [rad]
  std::map<std::string, Eigen::VectorXd> poses;          // by name: the neutral pose but for what the card says [rad]
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
  RobotRoles roles;
  FallRule fall;                     // where the card has none: 0.57 of the standing height
  std::optional<StanceSize> stance;  // of the card
  std::optional<RootBounds> root_bounds;
  std::string digest;  // SHA-256 over the URDF and what the card says, with what it extends (robots/card.h)

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
  // The values of the card, or std::invalid_argument naming the robot and the missing key.
  [[nodiscard]] const StanceSize& stance_size() const;
  [[nodiscard]] const RootBounds& bounds_of_root() const;
  // A pose of the card by name, or null.
  [[nodiscard]] const Eigen::VectorXd* pose(std::string_view name) const;
  // Standing in the neutral pose at `X_WB`'s x, y and yaw, at rest, soles on the ground z = 0.
  [[nodiscard]] RobotState standing_state(const Pose& X_WB = {}) const;
  // The card's gains around a target.
  [[nodiscard]] JointCommand default_command(const Eigen::VectorXd& q_target) const;
};

// Throws InputError ("weights.safetensors: made for 'g1', the robot is 't1'") where something was made for another
// robot.
void require_made_for(const std::string& made_for, const RobotModel& robot, const std::string& file);

// Loads a card, the cards that it extends, and the URDF it names (relative to the card; `urdf_path`, where given,
// replaces it). Meshes need not exist. Throws MissingError where the card's URDF is nowhere; InputError with file,
// element, expected and found: a broken URDF, a cycle or two roots, a joint that is neither revolute nor fixed
// (continuous is taken as +-2 pi), a joint of card or URDF that the other lacks, unknown keys of the card, a role that
// names no joint of it, values that are not finite or out of range (mass <= 0, lower > upper, ...).
RobotModel load_robot(const std::string& card_path, const std::string& urdf_path = "");

// The card that stands in where none is named: robots/g1/g1.yaml (robots/robot_cards.h says where it is looked for).
std::string default_card_path();
// The card of that name ("t1", "g1_27dof") in any folder below robots/; a path that ends in .yaml is the card itself.
// Throws MissingError, with the nearest and all known names, where there is none; InputError where two have the name.
std::string card_path(const std::string& name_or_path);

// The robot of a card by name or path, or where that is empty of the one that stands in, to be shared by episodes and
// threads.
std::shared_ptr<const RobotModel> load_shared_robot(const std::string& name_or_path = "");

// Where the frame of a robot's base is. A URDF may have its origin anywhere, as exports from CAD do; heights that mean
// the body (a fall, standing, a root that is followed) need it near the pelvis. load_robot moves it there where it is
// further away than kOriginShare of the pelvis's height over the soles, and nothing else knows of it but files that
// hold the URDF's own origin.

inline constexpr double kOriginShare = 0.4;  // the T1's trunk is .23 of it from the pelvis, the G1's pelvis 0

// The same robot with its base's origin at `p_B`, given in the base's frame [m].
RobotModel with_origin_at(RobotModel robot, const Eigen::Vector3d& p_B);

// The URDF's origin of the base, in the base's frame [m]: zero but for a robot whose origin was moved.
Eigen::Vector3d urdf_origin(const RobotModel& robot);

// Notes for the user on how a card's files were read, in sentences: an origin that was moved, what of the URDF is not
// simulated. `card`: by name or path. Throws as load_robot.
std::vector<std::string> robot_notes(const std::string& card);

}  // namespace duet
