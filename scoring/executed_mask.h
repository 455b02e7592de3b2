// The mask of what a robot's executor did of the reference: what nothing moved cannot be scored as if it had been.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "duet/archives/npy/npz.h"
#include "duet/robots/robot_model.h"

namespace duet {

// Channels of the 36-D reference (supplement A.4.1) in the order x, y, z, quaternion w, x, y, z, then the card's
// joints; x, y and the turn are executed as a velocity.
using ExecutedMask = std::vector<bool>;
// `joints`: that a limiter moves; `height`: the walking controller is told it.
ExecutedMask executed_mask(const RobotModel& robot, const std::vector<int>& joints, bool height);
// "root velocity and height; 14 of 29 joints, not left_hip_pitch_joint, ...". Throws std::invalid_argument for a mask
// of another robot's size.
std::string executed_mask_text(const ExecutedMask& mask, const RobotModel& robot);
// The key `executed` of a recording's archive. None where it has no such key; throws InputError for one of another
// size, or with other numbers than 0 and 1.
void put_executed_mask(const ExecutedMask& mask, Npz& npz);
std::optional<ExecutedMask> read_executed_mask(const Npz& npz);

}  // namespace duet
