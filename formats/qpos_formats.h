// Motions as rows of generalised positions: MuJoCo's qpos in archives (OmniRetarget, LocoMuJoCo, SPIDER), PHUMA's
// arrays, and duet's own files.
#pragma once

#include <vector>

#include "duet/formats/format_row.h"

namespace duet {

std::vector<RobotMotionFormat> qpos_formats();

}  // namespace duet
