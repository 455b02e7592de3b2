// One pose of a body. Targets become global joint rotations (spine by forward kinematics, limbs by two-bone analytic
// inverse kinematics) and the joints follow from these by p_child = p_parent + R_parent * offset: bones are exact.
#pragma once

#include <Eigen/Core>
#include <array>

#include "duet/tasks/synthesis/body.h"

namespace duet::synthesis {

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

struct Figure {
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
void pose_torso(const Body& body, const TorsoPose& torso, Figure& figure);
Eigen::Vector3d ankle_of(const Body& body, const FootPose& foot, int side);
// Needs the hips. The ankle must be within reach (the pelvis planner sees to it).
void pose_leg(const Body& body, const FootPose& foot, int side, Figure& figure);
// Needs the shoulders. A hand target beyond kArmReach of the arm's length is approached smoothly, never reached.
void pose_arm(const Body& body, const ArmPose& arm, int side, Figure& figure);

// Hand targets up to this share of upper arm + (forearm and hand) are met exactly.
inline constexpr double kArmReach = 0.975;
// Farthest ankle from hip that the legs are let have, in shares of thigh + shank: 2 acos(0.9965) = 9.6 degrees of knee.
inline constexpr double kLegReach = 0.9965;

}  // namespace duet::synthesis
