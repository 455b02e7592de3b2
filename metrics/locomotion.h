// How a robot walks: speed in its heading, drift, swings of its feet, and how its upper body follows meanwhile.
#pragma once

#include <map>
#include <string>

#include "duet/core/recording.h"
#include "duet/robots/robot_model.h"

namespace duet {

// Means are over what is after this: the start has its own [s].
inline constexpr double kWalkSettles = 2.0;

// Figures by catalogue name: speed_forward, speed_sideways [m/s], turn_rate [rad/s] (of recordings longer than
// kWalkSettles); drift [m]; swing_height, closest_feet [m] (of robots with two feet, swing_height where a foot swung);
// upper_body_error [rad], upper_body_rate_error [rad/s] (of the joints that are no leg's).
std::map<std::string, double> locomotion_metrics(const Recording& recording, const RobotModel& robot);

}  // namespace duet
