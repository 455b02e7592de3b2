// PAIR (supplement A.1): retargets one person of a clip to the robot while keeping the geometry between the two.
#pragma once

#include "motion/paired_motion.h"
#include "retarget/options.h"
#include "robots/robot_model.h"

namespace duet {

// The clip is resampled to 50 Hz where it is not. Throws std::invalid_argument: a clip that does not validate, fewer
// than 5 frames, a robot without the 16 pairs; MissingError: a kernel that this processor cannot run. Thread-safe; the
// result does not depend on the number of threads nor, bit for bit, on the choice between the AVX2 and AVX-512 kernels.
PairedMotion retarget(const InteractionClip& clip, const RobotModel& robot, const PairOptions& options = {});

// Kernels that run here, best first, scalar last. kV2 is always there on x86-64.
std::vector<KernelKind> available_kernels();
std::string_view to_string(KernelKind kernel);  // "auto", "scalar", "v2", "v3" (AVX2), "v4" (AVX-512)

}  // namespace duet
