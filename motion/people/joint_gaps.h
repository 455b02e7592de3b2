// Joints that a tracker did not see in some frames (NaN): short gaps are filled along straight lines, longer ones are
// refused.
#pragma once

#include <optional>
#include <string>

#include "duet/motion/people/raw_people.h"

namespace duet {

inline constexpr double kLongestGap = 0.25;  // of a joint that is not seen [s]

// A sentence where gaps were filled, with `filled` the people then; "" and nothing where all values are finite. Throws
// InputError naming person, frame and joint: a value that is not finite where the layout has no gaps, at either end of
// the recording, or for longer than kLongestGap; an infinite one anywhere.
std::string fill_gaps(const RawPeople& people, double rate_hz, std::optional<RawPeople>& filled);

}  // namespace duet
