// Facts that follow from a robot's roles: where the pelvis is, which of its joints tilt the trunk, how it mirrors.
// Functions of a loaded robot alone; thread-safe.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "duet/core/pose.h"
#include "duet/robots/robot_model.h"

namespace duet {

// Axis of the hinge of a joint in the base's frame at q = 0, unit.
Eigen::Vector3d hinge_axis(const RobotModel& robot, int joint);

// Image of a turn's axis in the plane y = 0.
Eigen::Vector3d mirrored_axis(const Eigen::Vector3d& axis);

// 1 where the mirror image of a joint at an angle is its counterpart at the same angle, -1 where at the opposite one.
double mirror_sign(const RobotModel& robot, int joint);

// Whether the joint turns about x rather than y: of an ankle or a hip, its roll.
bool is_roll(const RobotModel& robot, int joint);

// The waist's joints that tilt the trunk: all but those about the vertical.
std::vector<int> tilting_waist(const RobotModel& robot);

// Joints of both legs, ascending.
std::vector<int> leg_joints(const RobotModel& robot);

// The soles' shapes by the link that carries them, in the card's order: the left foot's first.
std::vector<std::vector<int>> soles_of_feet(const RobotModel& robot);

// Length of an arm from the shoulder's track along the links to the hand's, 0 left, 1 right: as far as it reaches
// stretched out; in the neutral pose where the shoulder's track lies on the trunk. [m] Throws std::invalid_argument
// where the card lacks one of the two tracks.
double arm_length(const RobotModel& robot, int side);

// The frame that stands for the person's pelvis (the first retarget pair's; the base's origin where there is none), in
// the base. A robot whose base is its trunk has its pelvis below a waist, which turns it. q: dof.
Pose pelvis_in_base(const RobotModel& robot, const Eigen::VectorXd& q);

// Whether the pelvis is the base's own frame, so that pelvis_in_base is the identity to the bit.
bool base_is_pelvis(const RobotModel& robot);

}  // namespace duet
