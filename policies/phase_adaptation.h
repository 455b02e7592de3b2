// Supplement A.4.4: adapts a retargeted motion by phase. Act is kept; preparation and follow-up become smooth
// primitives.
#pragma once

#include <cstdint>

#include "core/robot_motion.h"
#include "core/task.h"
#include "robots/robot_model.h"

namespace duet {

enum class StartMode {
  kClip,      // the motion as retargeted, whole clip
  kApproach,  // A.4.4: root starts within 1 m of the original start, bilinear interpolation to the first act frame
  kAct,       // for controllers that cannot walk: root at the act position from the start, upper body ramps in place
};

struct AdaptedMotion {
  RobotMotion motion;  // 50 Hz
  Phases phases;       // of its frames
  int clip_frame = 0;  // frame of the clip that its frame 0 is: the partner's motion is cut there
};

struct AdaptationOptions {
  StartMode start = StartMode::kApproach;
  double start_radius = 1.0;  // [m], kApproach
  double lead = 1.0;          // of neutral-to-act ramp kept before the act with kAct [s]
  double return_time = 1.0;   // over which the upper body goes back to neutral after the act [s]
  bool hold_stance = true;    // kAct: legs stay in the standing pose, the pelvis keeps its act position on the ground
};

// Throws std::invalid_argument where the phases do not fit the motion or options are out of range.
AdaptedMotion adapt_by_phase(const RobotMotion& motion, const Phases& phases, const RobotModel& robot,
                             const AdaptationOptions& options, std::uint64_t seed);

}  // namespace duet
