// A partner who moves otherwise than the clip: of another size, faster, later, hesitating, or turning back. Physics,
// policy, detectors and recording all have this partner; the robot's reference stays that of the clip.
#pragma once

#include <optional>

#include "duet/core/task.h"
#include "duet/motion/human_motion.h"

namespace duet {

struct PartnerVariation {
  double scale = 1.0;  // of the body about the place on the ground below its root; the way it walks stays
  double speed = 1.0;  // of its motion, from the episode's start on
  // Above 0: waits so long before it starts. Below 0: starts so far into its preparation, at most at the act. [s]
  double shift_s = 0.0;
  double hesitate_s = 0.0;  // stands still so long at half of its preparation [s]
  bool abort = false;       // at the middle of the act it goes back the way it came, as fast, and stays where it began
};

// Ticks of an episode whose reference has so many (50 Hz): as many more as the partner needs to do at least what it
// does in the clip by then (shift, hesitation, a speed below 1).
int episode_ticks(const PartnerVariation& variation, int reference_ticks);

// What the partner does from tick 0 on, `frames` frames of it, never past the clip's end. Frame 0 of the episode is
// `clip_frame` of the clip, `phases` are the episode's. Without a variation the clip's own frames to the bit, the last
// one repeated.
HumanMotion partner_motion(const HumanMotion& clip, const std::optional<PartnerVariation>& variation,
                           const Phases& phases, int clip_frame, int frames);

}  // namespace duet
