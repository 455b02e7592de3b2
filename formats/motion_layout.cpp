#include "duet/formats/motion_layout.h"

#include <fmt/format.h>

#include <algorithm>
#include <deque>
#include <string>
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

std::string_view to_string(TreeOrder order) {
  return order == TreeOrder::kDepthFirst ? "depth-first" : "breadth-first";
}

TreeOrder parse_tree_order(std::string_view name) {
  const std::vector<std::string> known = {"depth-first", "breadth-first"};
  for (const TreeOrder order : {TreeOrder::kDepthFirst, TreeOrder::kBreadthFirst})
    if (name == to_string(order)) return order;
  throw std::invalid_argument(unknown_name_message("order", name, known));
}

std::vector<int> links_in_order(const RobotModel& robot, TreeOrder order) {
  std::vector<std::vector<int>> children(robot.links.size());
  for (std::size_t i = 1; i < robot.links.size(); ++i)
    children[static_cast<std::size_t>(robot.links[i].parent)].push_back(static_cast<int>(i));
  std::vector<int> visited;
  std::deque<int> open = {0};
  while (!open.empty()) {
    const int link = open.front();
    open.pop_front();
    visited.push_back(link);
    const std::vector<int>& next = children[static_cast<std::size_t>(link)];
    open.insert(order == TreeOrder::kDepthFirst ? open.begin() : open.end(), next.begin(), next.end());
  }
  return visited;
}

std::vector<int> joints_in_order(const RobotModel& robot, TreeOrder order) {
  std::vector<int> joints = links_in_order(robot, order);
  joints.erase(joints.begin());
  for (int& joint : joints) --joint;  // links[i] is moved by joints[i - 1]
  return joints;
}

std::vector<int> without_wrists(const RobotModel& robot, std::vector<int> joints) {
  const std::vector<int>& wrists = robot.roles.wrists;
  std::erase_if(joints, [&](int j) { return std::find(wrists.begin(), wrists.end(), j) != wrists.end(); });
  return joints;
}

namespace {

int joint_of(const RobotModel& robot, const std::string& name) {
  for (std::size_t j = 0; j < robot.joints.size(); ++j)
    if (robot.joints[j].name == name || robot.joints[j].name == name + "_joint") return static_cast<int>(j);
  return -1;
}

ColumnBinding bind_by_order(const std::string& path, std::size_t columns, const RobotModel& robot) {
  ColumnBinding binding{.depth_first = joints_in_order(robot, TreeOrder::kDepthFirst),
                        .breadth_first = joints_in_order(robot, TreeOrder::kBreadthFirst)};
  if (columns == binding.depth_first.size()) return binding;
  const std::size_t all = binding.depth_first.size();
  binding.depth_first = without_wrists(robot, binding.depth_first);
  binding.breadth_first = without_wrists(robot, binding.breadth_first);
  if (columns != binding.depth_first.size())
    throw InputError(fmt::format("'{}': expected {} joints for robot '{}' ({} without wrists), found {}", path, all,
                                 robot.name, binding.depth_first.size(), columns));
  binding.evidence.push_back(
      fmt::format("{} columns: the joints of '{}' without its wrists, which are held straight", columns, robot.name));
  return binding;
}

ColumnBinding bind_by_name(const std::string& path, const std::vector<std::string>& names, const RobotModel& robot) {
  std::vector<std::string> foreign, missing = robot.joint_names();
  std::vector<int> named;
  for (const std::string& name : names) {
    const int joint = joint_of(robot, name);
    if (joint >= 0 && std::find(named.begin(), named.end(), joint) != named.end())
      throw InputError(fmt::format("'{}': joint '{}' stands twice", path, excerpt(name)));
    named.push_back(joint);
    if (joint < 0) foreign.push_back(name);
    if (joint >= 0) std::erase(missing, robot.joints[static_cast<std::size_t>(joint)].name);
  }
  if (missing.size() * 2 > robot.joints.size())
    throw InputError(fmt::format("'{}': expected the joints of robot '{}', found {}", path, robot.name,
                                 excerpt(fmt::format("{}", fmt::join(names, ", ")))));
  ColumnBinding binding{.depth_first = named, .breadth_first = named};
  binding.evidence.push_back(fmt::format("joints: {}, bound by name", names.size() - foreign.size()));
  if (!missing.empty())
    binding.evidence.push_back(fmt::format("held straight, not in the file: {}", fmt::join(missing, ", ")));
  if (!foreign.empty())
    binding.evidence.push_back(
        fmt::format("left out, not of '{}': {}", robot.name, excerpt(fmt::format("{}", fmt::join(foreign, ", ")))));
  return binding;
}

}  // namespace

ColumnBinding bind_columns(const std::string& path, const std::vector<std::string>& names, Eigen::Index columns,
                           const RobotModel& robot) {
  const auto found = static_cast<std::size_t>(columns);
  if (names.empty()) return bind_by_order(path, found, robot);
  if (names.size() != found)
    throw InputError(fmt::format("'{}': expected {} joints as named, found {} columns", path, names.size(), found));
  return bind_by_name(path, names, robot);
}

}  // namespace duet
