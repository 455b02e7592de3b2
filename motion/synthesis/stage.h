// Sets the scene: two bodies, their ways to each other and apart, and when everything happens.
#pragma once

#include "duet/core/task.h"
#include "duet/motion/synthesis_options.h"
#include "duet/tasks/synthesis/act.h"

namespace duet::synthesis {

struct Staged {
  Scene scene;
  int frames = 0;
};

// Draws what `options` (already checked) leaves open and plans everything but the act's gestures. Throws
// std::invalid_argument where a duration was asked for that is too short for the ways and the act.
Staged set_stage(Task task, const SynthesisOptions& options, Draws& draws);

// Whoever turns round to leave stops looking at the partner; to be called once the act has been performed.
void look_away(Scene& scene);

}  // namespace duet::synthesis
