// A partner who moves otherwise than the clip: of another size, faster, later, hesitating, turning back, walking up,
// moving on, with the other hand. Physics, policy, detectors and recording all have this partner; the robot's reference
// stays that of the clip.
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
  // Ways on the ground, the body as in the clip, in the axes of its heading in the first frame of the act, in which it
  // faces the other person. Absent: none, and not written, as in suites of before.
  std::optional<double> comes_m = {};     // begins so far behind its place and is there after half of its preparation
  std::optional<double> moves_on_m = {};  // over the second half of it goes so far back, and stays there
  std::optional<double> aside_m = {};     // and so far to its left
  std::optional<bool> other_hand = {};    // every pose is the mirror image of the clip's, about its own middle plane
};

// Ticks of an episode whose reference has so many (50 Hz): as many more as the partner needs to do at least what it
// does in the clip by then (shift, hesitation, a speed below 1).
int episode_ticks(const PartnerVariation& variation, int reference_ticks);

// The partner's motion from tick 0 on, `frames` frames of it, never past the clip's end. Frame 0 of the episode is
// `clip_frame` of the clip, `phases` are the episode's. Without a variation the clip's own frames to the bit, the last
// one repeated.
HumanMotion partner_motion(const HumanMotion& clip, const std::optional<PartnerVariation>& variation,
                           const Phases& phases, int clip_frame, int frames);

}  // namespace duet
