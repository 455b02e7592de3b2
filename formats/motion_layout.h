// The documented layout of a format's files, and corrections by a user who knows better.
#pragma once

#include <Eigen/Core>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "duet/robots/robot_model.h"

namespace duet {

// Orders in which files list a robot's joints and bodies without naming them. Functions of a loaded robot alone;
// thread-safe.

// Depth first is the order of URDF and MJCF (Unitree's motors, MuJoCo, mjlab); breadth first is IsaacLab's.
enum class TreeOrder { kDepthFirst, kBreadthFirst };

std::string_view to_string(TreeOrder order);  // "depth-first", "breadth-first"
// Throws std::invalid_argument with the known names.
TreeOrder parse_tree_order(std::string_view name);

// Indices in RobotModel::links, the base first. Siblings follow one another as in the card.
std::vector<int> links_in_order(const RobotModel& robot, TreeOrder order);

// Indices in RobotModel::joints.
std::vector<int> joints_in_order(const RobotModel& robot, TreeOrder order);

// The same without the card's wrists: the 23 joints of GMT and PHUMA on a G1.
std::vector<int> without_wrists(const RobotModel& robot, std::vector<int> joints);

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

// Which joint of a robot each column of a file is. Pure function.

// Indices in RobotModel::joints of the file's columns in either order (the same where the file names them); -1 where
// the robot lacks one.
struct ColumnBinding {
  std::vector<int> depth_first = {}, breadth_first = {};
  std::vector<std::string> evidence = {};
};

// Binds by name where there are `names`, with or without "_joint"; else as many columns as the robot has joints, or
// joints without its wrists. Throws InputError naming `path`: another number of columns, a joint that stands twice,
// less than half of the robot's joints.
ColumnBinding bind_columns(const std::string& path, const std::vector<std::string>& names, Eigen::Index columns,
                           const RobotModel& robot);

}  // namespace duet
