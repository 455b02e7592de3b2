// A controller whose arms something else moves, as a teleoperated robot's are: it is shown what they do, and its own
// answer for them goes nowhere.
#pragma once

#include <memory>

#include "duet/controllers/controller.h"

namespace duet {

// With the reference's angles as targets of all joints of both arms; gains, the other joints and what it is shown are
// `controller`'s. Wraps any controller. Throws std::invalid_argument for a robot without arms that move.
std::unique_ptr<Controller> make_reference_arms(std::unique_ptr<Controller> controller, const RobotModel& robot);

}  // namespace duet
