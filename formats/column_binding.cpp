#include "duet/formats/column_binding.h"

#include <fmt/format.h>

#include <algorithm>

#include "duet/core/require.h"
#include "duet/core/text.h"
#include "duet/formats/tree_order.h"

namespace duet {
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
      throw InputError(fmt::format("'{}': joint '{}' stands twice", path, shown(name)));
    named.push_back(joint);
    if (joint < 0) foreign.push_back(name);
    if (joint >= 0) std::erase(missing, robot.joints[static_cast<std::size_t>(joint)].name);
  }
  if (missing.size() * 2 > robot.joints.size())
    throw InputError(fmt::format("'{}': expected the joints of robot '{}', found {}", path, robot.name,
                                 shown(fmt::format("{}", fmt::join(names, ", ")))));
  ColumnBinding binding{.depth_first = named, .breadth_first = named};
  binding.evidence.push_back(fmt::format("joints: {}, bound by name", names.size() - foreign.size()));
  if (!missing.empty())
    binding.evidence.push_back(fmt::format("held straight, not in the file: {}", fmt::join(missing, ", ")));
  if (!foreign.empty())
    binding.evidence.push_back(
        fmt::format("left out, not of '{}': {}", robot.name, shown(fmt::format("{}", fmt::join(foreign, ", ")))));
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
