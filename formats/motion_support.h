// How far a robot's own body speaks for a motion: the limits of its joints, and soles that lie flat on the floor. It
// decides a fact that a file leaves open. Pure functions.
#pragma once

#include <string>

#include "duet/core/robot_motion.h"
#include "duet/robots/robot_model.h"

namespace duet {

struct MotionSupport {
  double inside = 1.0;  // share of the angles within the card's limits, give or take 0.1 rad
  // Medians of the lower foot; not a number where the card has no soles.
  double sole = 0.0;  // its lowest point over the floor [m]
  double tilt = 0.0;  // of its sole against the floor [rad]

  // The number of things that speak against the motion, 0 to 3: angles outside the limits, soles off the floor, soles
  // that do not lie on it.
  [[nodiscard]] int doubts() const;
  [[nodiscard]] bool fits_limits() const;
  [[nodiscard]] std::string text() const;  // "within the limits 98.1 %, lower sole at -0.057 m, tilted by 12 degrees"
};

// The support of a motion in some of its frames. The motion has the robot's joints in its order.
MotionSupport support_of(const RobotModel& robot, const RobotMotion& motion);

// Share of the steps between frames in which a joint is quicker than its limit; joints without one are passed over.
double share_too_quick(const RobotModel& robot, const RobotMotion& motion);

}  // namespace duet
