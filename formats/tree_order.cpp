#include "duet/formats/tree_order.h"

#include <algorithm>
#include <deque>
#include <string>

#include "duet/core/names.h"
#include "duet/core/require.h"

namespace duet {

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

}  // namespace duet
