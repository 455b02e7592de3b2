// Joints within the limits of their speed.
#pragma once

#include "duet/core/robot_motion.h"
#include "duet/robots/robot_model.h"

namespace duet {

// The mean of the nearest motions above and below `motion` whose joints never move faster than the robot's limits
// (RobotJoint::velocity; one that is 0 is no limit). Frames around which nothing is too fast stay as they are to the
// last bit of a mean, angles stay between those that the joint had, and where angles differ by at most d before, they
// do so after. Throws std::invalid_argument: a motion of another robot.
void keep_joint_speeds(const RobotModel& robot, RobotMotion& motion);

}  // namespace duet
