#include "duet/formats/motion_layout.h"

#include <vector>

#include "duet/core/names.h"
#include "duet/core/require.h"

namespace duet {

std::string_view to_string(QuaternionOrder order) { return order == QuaternionOrder::kXyzw ? "xyzw" : "wxyz"; }
std::string_view to_string(AngleUnit unit) { return unit == AngleUnit::kRadians ? "rad" : "deg"; }

QuaternionOrder parse_quaternion_order(std::string_view name) {
  const std::vector<std::string> known = {"xyzw", "wxyz"};
  for (const QuaternionOrder order : {QuaternionOrder::kXyzw, QuaternionOrder::kWxyz})
    if (name == to_string(order)) return order;
  throw std::invalid_argument(unknown_name_message("order of quaternions", name, known));
}

AngleUnit parse_angle_unit(std::string_view name) {
  const std::vector<std::string> known = {"rad", "deg"};
  for (const AngleUnit unit : {AngleUnit::kRadians, AngleUnit::kDegrees})
    if (name == to_string(unit)) return unit;
  throw std::invalid_argument(unknown_name_message("unit of angles", name, known));
}

}  // namespace duet
