// Automatic proposal of the three phases for a clip without annotations (supplement B.4 annotated by hand).
#pragma once

#include "duet/core/task.h"
#include "duet/motion/human_motion.h"

namespace duet {

// Phases from the two motions alone: the approach ends when the roots' distance stops shrinking and the hands begin the
// act; the follow-up begins when the hands are back and the roots part. Always act_begin < act_end. The method stands
// in docs/conventions.md.
Phases propose_phases(const HumanMotion& a, const HumanMotion& b, Task task);

}  // namespace duet
