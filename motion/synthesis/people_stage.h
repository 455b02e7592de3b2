// Sets the scene as recorded people do: two who stand close, a step or two, quick hands, a short touch; the clip is
// cropped to it. Some hesitate, some break off. Figures and their sources: docs/synthesis.md and the tasks' files.
#pragma once

#include "duet/motion/synthesis/stage.h"

namespace duet::synthesis {

// Draws what `options` (already checked) leaves open and plans everything but the act's gestures; who hesitates does so
// here. `outcome` says how the act ends.
Staged set_people_stage(Task task, const SynthesisOptions& options, Draws& draws, ActOutcome& outcome);

// In place of the act's gestures: A, and perhaps B, reaches half way and draws back.
void perform_abort(Scene& scene, Draws& draws);

}  // namespace duet::synthesis
