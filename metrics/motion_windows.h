// Short windows of one person's motion beside another, as features: what tells made motion from recorded motion. Pure
// functions.
#pragma once

#include <string>
#include <vector>

#include "duet/motion/interaction_clip.h"

namespace duet {

inline constexpr double kWindowRate = 15.0;       // at which a person is seen [Hz]
inline constexpr double kWindowSeconds = 0.6;     // of a window
inline constexpr double kWindowStep = 1.0 / 3.0;  // from one window's begin to the next [s]

// The features, in order, of the joints that a depth camera has (layout "kinect-15" but for the pelvis), in a frame at
// the pelvis that stands upright and faces as the shoulders do: where each is in the window's middle [m], how far the
// moving ones (head, elbows, hands) come in it [m], how unsteady they are (residual against the middle of the frames
// around, mean) [m]; and the other's pelvis: distance [m], and direction [rad].
const std::vector<std::string>& window_feature_names();

// One row a window and person. A person who does not move at all is a picture, no recording, and has none.
std::vector<std::vector<double>> motion_windows(const InteractionClip& clip);

}  // namespace duet
