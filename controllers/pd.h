// The card's gains around the reference's joint angles and nothing else: no balance. It falls within about a second and
// says so in the table; what stands longer is the other controllers' merit.
#pragma once

#include <memory>

#include "duet/controllers/controller.h"

namespace duet {

std::unique_ptr<Controller> make_pd_controller(std::shared_ptr<const RobotModel> robot);

}  // namespace duet
