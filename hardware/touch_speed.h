// How fast a part of the robot may be when it touches a person. Pure; thread-safe.
#pragma once

#include "duet/metrics/contact_limits.h"

namespace duet {

// The largest relative speed of a quasi-static contact, F = v sqrt(mu k) with 1/mu = 1/m_person + 1/m_robot [m/s]; the
// transient limit is twice the force and is not made use of. `robot_mass`: that moves with the part [kg]. Throws
// std::invalid_argument for a region without force, stiffness or mass. Source: ISO/TS 15066, A.3.6, from secondary
// sources.
double touch_speed(const RegionLimits& region, double robot_mass);

}  // namespace duet
