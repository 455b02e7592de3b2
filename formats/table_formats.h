// Motions as tables of numbers: Unitree's and LAFAN1's, BONES-SEED's, hhtools'.
#pragma once

#include <vector>

#include "duet/formats/format_row.h"

namespace duet {

std::vector<RobotMotionFormat> table_formats();

}  // namespace duet
