// One pose of a body. Targets become global joint rotations (spine by forward kinematics, limbs by two-bone analytic
// inverse kinematics) and the joints follow from these by p_child = p_parent + R_parent * offset: bones are exact.
#pragma once

#include <Eigen/Core>
#include <array>
#include <vector>

#include "duet/core/recording.h"

namespace duet::synthesis {

// A body for synthesis: the 24 joints' offsets from their parents in the rest pose (standing, arms out to the sides;
// x forward, y left, z up), scaled from anthropometric ratios. [m]

// Factors on the mean proportions, 1 = mean.
struct Proportions {
  double legs = 1.0;  // the trunk takes up what the legs leave, so that the stature holds
  double arms = 1.0;
  double shoulders = 1.0;
  double hips = 1.0;
};

struct Body {
  double height = 0.0;  // stature, top of the head, legs straight
  std::array<Eigen::Vector3d, kSmplJoints> offset;
  double thigh = 0.0;
  double shank = 0.0;
  double upper_arm = 0.0;
  double forearm = 0.0;
  double hand = 0.0;          // wrist to hand joint
  double torso_radius = 0.0;  // of the capsule round the spine, pelvis to neck
  double stand_height = 0.0;  // of the pelvis, knees a little bent

  [[nodiscard]] double leg() const { return thigh + shank; }
  [[nodiscard]] double arm() const { return upper_arm + forearm + hand; }
  [[nodiscard]] double ankle_height() const;
  [[nodiscard]] double toe_height() const;
};

Body make_body(double height, const Proportions& proportions);

struct TorsoPose {
  Eigen::Vector3d pelvis = Eigen::Vector3d::Zero();
  double yaw = 0.0;                                        // of the person; 0 faces +x
  double pelvis_yaw = 0.0;                                 // of the pelvis against it
  double pelvis_pitch = 0.0, pelvis_roll = 0.0;            // forward; left side up
  double spine_bend = 0.0, spine_side = 0.0, twist = 0.0;  // spread over spine1..3: forward; to the right; to the left
  double look_yaw = 0.0, look_pitch = 0.0;                 // head against chest, shared by neck and head
  std::array<double, 2> shrug = {0.0, 0.0};                // collars, left and right, upward
};

// Where a foot is: its toe joint, and its direction. pitch > 0: heel up.
struct FootPose {
  Eigen::Vector3d toe = Eigen::Vector3d::Zero();
  double yaw = 0.0;
  double pitch = 0.0;
};

struct ArmPose {
  Eigen::Vector3d hand = Eigen::Vector3d::Zero();    // where the hand joint goes
  Eigen::Vector3d pole = -Eigen::Vector3d::UnitX();  // where the elbow points
  double wrist = 0.0;                                // bend of the hand in the elbow's plane, as the elbow bends; [rad]
};

struct PosedBody {
  std::array<Eigen::Matrix3d, kSmplJoints> R;  // R_WJ
  Eigen::Matrix<double, 3, kSmplJoints> p;     // p_WJ
  double yaw = 0.0;
};

// Side index of limbs here: 0 left, 1 right.
constexpr double side_sign(int side) { return side == 0 ? 1.0 : -1.0; }
constexpr int sided(SmplJoint left, int side) { return side == 0 ? static_cast<int>(left) : kSmplMirror[left]; }

Eigen::Matrix3d rot_x(double angle);
Eigen::Matrix3d rot_y(double angle);
Eigen::Matrix3d rot_z(double angle);

// Pelvis, spine, head, collars, shoulders and hips.
void pose_torso(const Body& body, const TorsoPose& torso, PosedBody& figure);
Eigen::Vector3d ankle_of(const Body& body, const FootPose& foot, int side);
// Needs the hips. The ankle must be within reach (the pelvis planner sees to it).
void pose_leg(const Body& body, const FootPose& foot, int side, PosedBody& figure);
// Needs the shoulders. A hand target beyond kArmReach of the arm's length is approached smoothly, never reached.
void pose_arm(const Body& body, const ArmPose& arm, int side, PosedBody& figure);

// Hand targets up to this share of upper arm + (forearm and hand) are met exactly.
inline constexpr double kArmReach = 0.975;
// Farthest ankle from hip that the legs are let have, in shares of thigh + shank: 2 acos(0.9965) = 9.6 degrees of knee.
inline constexpr double kLegReach = 0.9965;

// Bodies that a hand cannot pass: capsules round head and trunk, sized as those of the solid partner
// (robots/human_body.cpp; a test holds the two against each other), and the hand's own.

struct SolidPart {
  Eigen::Vector3d from, to;  // ends of the axis, in W [m]
  double radius = 0.0;       // [m]
};

// The parts of a figure whose torso is posed.
std::vector<SolidPart> solid_parts(const Body& body, const PosedBody& figure);
// The hand of a figure whose arm is posed.
SolidPart solid_hand(const Body& body, const PosedBody& figure, int side);

// How deep two parts are in each other [m], negative: how far apart; and the unit vector that takes the first out.
struct Overlap {
  double depth = 0.0;
  Eigen::Vector3d out = Eigen::Vector3d::UnitZ();
};
Overlap overlap_of(const SolidPart& part, const SolidPart& other);

// Poses the arm like pose_arm, but so that the hand is on or outside of `partner`: the target goes out until it is.
void pose_arm_outside(const Body& body, const ArmPose& arm, int side, const std::vector<SolidPart>& partner,
                      PosedBody& figure);

}  // namespace duet::synthesis
