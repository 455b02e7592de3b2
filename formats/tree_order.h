// Orders in which files list a robot's joints and bodies without naming them. Functions of a loaded robot alone;
// thread-safe.
#pragma once

#include <string_view>
#include <vector>

#include "duet/robots/robot_model.h"

namespace duet {

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

}  // namespace duet
