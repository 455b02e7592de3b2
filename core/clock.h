// The clock that controllers are called at and motions are stored at: 50 Hz (supplement A.1.1, F). A tick is one
// period.
#pragma once

#include <cmath>

namespace duet {

inline constexpr double kTickRate = 50.0;  // [Hz]
inline constexpr double kTick = 0.02;      // [s]

inline int ticks_of(double seconds) { return static_cast<int>(std::lround(seconds * kTickRate)); }

}  // namespace duet
