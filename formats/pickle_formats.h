// Robot motions in pickles: GMR, TWIST, TWIST2 and GMT; PHC, ASAP and SONIC's motion libraries.
#pragma once

#include <vector>

#include "duet/formats/format_row.h"

namespace duet {

std::vector<RobotMotionFormat> pickle_formats();

}  // namespace duet
