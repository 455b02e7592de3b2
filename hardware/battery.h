// The robot's battery, as its own topic says.
#pragma once

#include <limits>

namespace duet {

struct BatteryReading {
  double charge = std::numeric_limits<double>::quiet_NaN();  // [%]
};
// The time for which a reading stands; what is older is not known. The topic is slow [s].
inline constexpr double kBatteryAge = 5.0;

}  // namespace duet
