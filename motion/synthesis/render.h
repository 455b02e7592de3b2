// From two performers to joints: pelvis heights that keep both legs within reach, then trunk, legs and arms frame by
// frame.
#pragma once

#include <array>

#include "duet/motion/human_motion.h"
#include "duet/tasks/synthesis/performer.h"

namespace duet::synthesis {

std::array<HumanMotion, 2> render(const std::array<Performer, 2>& people, int frames, double rate_hz);

}  // namespace duet::synthesis
