// Keeps numbers that are not finite away from the motors, whatever the controller does. Wraps any controller; every
// one that make_controller returns is wrapped.
#pragma once

#include <memory>

#include "duet/controllers/controller.h"

namespace duet {

// Ticks (at 50 Hz) for which the last finite command is held before the safe stop.
inline constexpr int kGuardHeldTicks = 5;
// Ticks over which the safe stop takes the card's kp down to 0; kd is the card's throughout.
inline constexpr int kGuardRampTicks = 25;

// A tick on which the state or the reference is not finite does not reach `controller`. On it, and on one whose command
// is not finite, the last finite command stands (before the first: the angles measured at reset with the card's gains)
// for kGuardHeldTicks in a row. After that comes the safe stop, for good: targets at the angles last measured, kp
// falling to 0 over kGuardRampTicks, the card's kd. reset() clears all of it. Throws std::invalid_argument in act() for
// a state or a reference of another robot's size, and in reset() for a state that is not finite.
std::unique_ptr<Controller> make_guarded(std::unique_ptr<Controller> controller,
                                         const std::shared_ptr<const RobotModel>& robot);

}  // namespace duet
