// How a robot walks: speed in its heading, drift, swings of its feet, and how its upper body follows meanwhile.
#pragma once

#include <map>
#include <string>

#include "duet/core/recording.h"
#include "duet/motion/paired_motion.h"
#include "duet/robots/robot_model.h"

namespace duet {

// Means are over what is after this: the start has its own [s].
inline constexpr double kWalkSettles = 2.0;

// Figures by catalogue name: speed_forward, speed_sideways [m/s], turn_rate [rad/s] (of recordings longer than
// kWalkSettles); drift [m]; swing_height, closest_feet [m] (of robots with two feet, swing_height where a foot swung);
// upper_body_error [rad], upper_body_rate_error [rad/s] (of the joints that are no leg's).
std::map<std::string, double> locomotion_metrics(const Recording& recording, const RobotModel& robot);

// How a retargeted motion stands and moves, beside the 18 metrics: soles over the floor, skating, bodies in each other,
// the partner's bones, peaks of the joints, limits, the base's lean. Physics asks for these, the supplement not.

// Figures by catalogue name; NaN where undefined (no foot stands, a robot without soles).
//   sole_height, sole_height_max  [m]      distance of the middle of a sole from the floor z = 0
//                                          while the person's foot stands (motion/human_motion.h):
//                                          median and largest
//   foot_skate, foot_skate_max    [m/s]    horizontal speed of the middle of a sole meanwhile: mean and 99th percentile
//   penetration, penetration_max  [m]      depth of the robot's shapes in the partner's capsules, but for hands and
//                                          forearms of the two, which are meant to meet: mean over frames and largest
//   self_penetration_max          [m]      of the pairs of shapes that the card lists
//   bone_change_max               [m]      of the partner's arm bones against the source, any frame
//   joint_speed_max               [rad/s]  joint_acceleration_max [rad/s^2] of any joint
//   limit_violations              [1]      frames and joints outside the limits by more than 1e-9 rad
//   speed_violations              [1]      steps between frames in which a joint is quicker than its limit (by more
//                                          than 1e-9 of it); joints without a limit are passed over
//   root_roll_max, root_tilt_max  [rad]    of the base: sideways, and between its z axis and the vertical
std::map<std::string, double> grounding_metrics(const PairedMotion& motion, const RobotModel& robot);

}  // namespace duet
