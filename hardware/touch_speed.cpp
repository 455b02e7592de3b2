#include "duet/hardware/touch_speed.h"

#include <cmath>

#include "duet/core/require.h"

namespace duet {

double touch_speed(const RegionLimits& region, double robot_mass) {
  require(region.quasi_static_n && region.stiffness_n_mm && region.mass_kg,
          "contact limits of region '{}': expected quasi_static_n, stiffness_n_mm and mass_kg, found less",
          region.region);
  require(robot_mass > 0.0, "touch speed: expected a mass above 0 kg, found {}", robot_mass);
  const double reduced_mass = 1.0 / (1.0 / *region.mass_kg + 1.0 / robot_mass);
  return *region.quasi_static_n / std::sqrt(reduced_mass * *region.stiffness_n_mm * 1000.0);
}

}  // namespace duet
