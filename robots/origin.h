// Where the frame of a robot's base is. A URDF may have its origin anywhere, as exports from CAD do; heights that mean
// the body (a fall, standing, a root that is followed) need it near the pelvis. load_robot moves it there where it is
// further away than kOriginShare of the pelvis's height over the soles, and nothing else knows of it but files that
// hold the URDF's own origin.
#pragma once

#include <Eigen/Core>
#include <string>
#include <vector>

#include "duet/robots/robot_model.h"

namespace duet {

inline constexpr double kOriginShare = 0.4;  // the T1's trunk is .23 of it from the pelvis, the G1's pelvis 0

// The same robot with its base's origin at `p_B`, given in the base's frame [m].
RobotModel with_origin_at(RobotModel robot, const Eigen::Vector3d& p_B);

// The URDF's origin of the base, in the base's frame [m]: zero but for a robot whose origin was moved.
Eigen::Vector3d urdf_origin(const RobotModel& robot);

// Notes for the user on how a card's files were read, in sentences: an origin that was moved, what of the URDF is not
// simulated. `card`: by name or path. Throws as load_robot.
std::vector<std::string> robot_notes(const std::string& card);

}  // namespace duet
