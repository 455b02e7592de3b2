// The documented layout of a format's files, and corrections by a user who knows better.
#pragma once

#include <optional>
#include <string>
#include <string_view>

#include "duet/formats/tree_order.h"

namespace duet {

inline constexpr double kLowestRate = 0.1, kHighestRate = 10'000.0;  // of a motion that is read or written [Hz]

enum class QuaternionOrder { kXyzw, kWxyz };
enum class AngleUnit { kRadians, kDegrees };
std::string_view to_string(QuaternionOrder order);  // "xyzw", "wxyz"
std::string_view to_string(AngleUnit unit);         // "rad", "deg"
// Throw std::invalid_argument with the known names.
QuaternionOrder parse_quaternion_order(std::string_view name);
AngleUnit parse_angle_unit(std::string_view name);

// The layout of a format's files according to its documentation.
struct MotionLayout {
  QuaternionOrder quaternion = QuaternionOrder::kXyzw;
  bool turns = false;                         // no quaternion but turns about the fixed axes x, then y, then z
  TreeOrder joints = TreeOrder::kDepthFirst;  // of joints (and bodies) without names
  AngleUnit angles = AngleUnit::kRadians;
  double metres = 1.0;   // per unit of length
  double rate_hz = 0.0;  // 0: the file says
};

// Facts known better than by the file and the documentation. An empty one is detected, or taken as documented.
struct RobotMotionOptions {
  std::optional<double> rate_hz = {};
  std::optional<QuaternionOrder> quaternion = {};
  std::optional<TreeOrder> joints = {};
  std::optional<AngleUnit> angles = {};
  std::optional<double> metres = {};  // per unit of length
  std::string motion = {};            // of a file with several: its name or number
};

}  // namespace duet
