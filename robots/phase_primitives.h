// Primitives that take the place of a motion's preparation and follow-up (supplement A.4.4; section D with Algorithm
// 7). The act is never touched. Legs are those of the robot's card, every other joint is upper body. Motions have the
// robot's joints in its order. Pure functions.
#pragma once

#include "duet/core/pose.h"
#include "duet/core/robot_motion.h"
#include "duet/core/task.h"
#include "duet/robots/robot_model.h"

namespace duet {

inline constexpr int kSimToRealRamp = 16;      // frames of either ramp of Algorithm 7
inline constexpr double kSimToRealYaw = 0.35;  // "milder yaw" of section D, which prints no figure [rad]

// Preparation: the root from `start` straight to the first act frame, at an even pace.
void walk_straight(RobotMotion& motion, const Phases& phases, const Pose& start);

// Preparation: the upper body from neutral to the first act frame over the last `frames`, at most all of it.
void raise_upper_body(RobotMotion& motion, const Phases& phases, const RobotModel& robot, int frames);

// Follow-up: the upper body from the last act frame back to neutral over `frames`.
void lower_upper_body(RobotMotion& motion, const Phases& phases, const RobotModel& robot, double frames);

// Frames [begin, end): root and legs as in frame `source`.
void hold_frame(RobotMotion& motion, const RobotModel& robot, int begin, int end, int source);

// `start` turned about the vertical until its heading is at most `mild_yaw` [rad] from that of `goal`.
Pose mildly_turned(const Pose& start, const Pose& goal, double mild_yaw);

// Algorithm 7. Preparation: the root goes straight from where it starts to the first act frame and turns by at most
// `mild_yaw`; the upper body is neutral and goes to the first act frame over the last 16 frames; legs as they are.
// Follow-up: root and legs as in the last act frame, the upper body goes back to neutral over 16 frames. Throws
// std::invalid_argument where motion, robot and phases do not fit (0 <= act_begin < act_end <= frames) or `mild_yaw` is
// negative.
void sim_to_real(RobotMotion& motion, const Phases& phases, const RobotModel& robot, double mild_yaw = kSimToRealYaw);

}  // namespace duet
