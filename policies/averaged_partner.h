// A filter for any policy that sees a noisy partner: in each frame of what it is shown, the partner is where the last
// kHistoryFrames frames have them on average (0.24 s, so 0.11 s late). The robot's own state stays as it was sensed.
#pragma once

#include <memory>

#include "duet/policies/policy.h"

namespace duet {

inline constexpr const char* kAverage = "average";  // the option by which a suite asks for it

// The policy with the filter before plans and corrections. It remembers what it was shown: over a gap between two calls
// that a history does not span, the partner counts as having been where the gap ends.
std::unique_ptr<Policy> with_averaged_partner(std::unique_ptr<Policy> policy);

}  // namespace duet
