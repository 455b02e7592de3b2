// The five anchors of a plan, and the 50 Hz references between them (supplement F, Algorithm 8).
#pragma once

#include <array>
#include <vector>

#include "duet/core/robot_state.h"

namespace duet {

inline constexpr int kAnchors = 5;             // at t + {0, 0.5, 1, 1.5, 2} s
inline constexpr double kAnchorSpacing = 0.5;  // [s]
inline constexpr int kTicksPerAnchor = 25;
inline constexpr int kTicksPerPlan = 10;  // 5 Hz on the 50 Hz clock

using Anchors = std::array<Reference, kAnchors>;

// Algorithm 8: anchors of a call -> 100 references on the 50 Hz grid, i/50 s after the call. Positions and joints
// linear, rotation slerp.
std::vector<Reference> densify(const Anchors& anchors);

// Positions and joints linear, rotation slerp (shorter arc); s = 0 gives a to the bit.
Reference interpolate(const Reference& a, const Reference& b, double s);

}  // namespace duet
