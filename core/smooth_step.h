// The cubic from 0 to 1 that sets out and arrives at rest.
#pragma once

namespace duet {

// s in [0, 1]; who goes beyond it bounds s first.
constexpr double smooth_step(double s) { return s * s * (3.0 - 2.0 * s); }

}  // namespace duet
