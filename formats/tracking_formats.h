// Motions for tracking policies, with the poses and velocities of all bodies: BeyondMimic's and holosoma's archives,
// SONIC's folders.
#pragma once

#include <vector>

#include "duet/formats/format_row.h"

namespace duet {

std::vector<RobotMotionFormat> tracking_formats();

}  // namespace duet
