// Domain randomisation of A.3.2: bodies that are not quite the nominal one.
#pragma once

#include <memory>

#include "duet/core/random.h"
#include "duet/robots/robot_model.h"
#include "duet/training/wbc_task.h"

namespace duet {

// The nominal body with other masses and another centre of mass of the torso. Gains, friction, kicks and pushes are the
// environment's.
std::shared_ptr<const RobotModel> draw_body(const RobotModel& nominal, const DomainOptions& options, Random& random);

}  // namespace duet
