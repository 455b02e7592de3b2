// PAIR (supplement A.1): retargets one person of a clip to the robot while keeping the geometry between the two.
#pragma once

#include "duet/motion/paired_motion.h"
#include "duet/retarget/kernels.h"
#include "duet/retarget/options.h"
#include "duet/robots/robot_model.h"

namespace duet {

// The clip is resampled to 50 Hz where it is not. Throws std::invalid_argument: a clip that does not validate, fewer
// than 5 frames, a robot without the 16 pairs; InputError: frames that need more memory than is left (some 24 kB each,
// core/memory_left.h); MissingError: a kernel that this processor cannot run. Thread-safe; the
// result does not depend on the number of threads nor, bit for bit, on the choice between the AVX2 and AVX-512 kernels.
PairedMotion retarget(const InteractionClip& clip, const RobotModel& robot, const PairOptions& options = {});

}  // namespace duet
