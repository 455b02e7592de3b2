// Two people as stick figures: what a person looks at to see why a clip was refused.
#pragma once

#include <string>
#include <vector>

#include "duet/motion/interaction_clip.h"

namespace duet {

// These frames side by side, seen from the side, as one SVG that stands alone (no style sheet, no script). The one whom
// the robot replaces is drawn in the robot's colour. Throws std::invalid_argument for a frame outside the clip.
std::string clip_picture_svg(const InteractionClip& clip, const std::vector<int>& frames, const std::string& title);

}  // namespace duet
