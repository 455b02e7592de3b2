// From two performers to joints: pelvis heights that keep both legs within reach, then trunk, legs and arms frame by
// frame.
#pragma once

#include <array>

#include "duet/motion/human_motion.h"
#include "duet/tasks/synthesis/performer.h"

namespace duet::synthesis {

// The part of the scene's time that a clip shows: from `first` on, `tempo` seconds of it in each second of the clip.
struct Showing {
  double first = 0.0;  // [s]
  double tempo = 1.0;
};

std::array<HumanMotion, 2> render(const std::array<Performer, 2>& people, int frames, double rate_hz,
                                  const Showing& showing = {});

}  // namespace duet::synthesis
