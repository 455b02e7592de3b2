#include "duet/io/joint_binding.h"

#include <algorithm>

namespace duet {

JointBinding bind_by_name(std::span<const std::string> names, const RobotModel& robot) {
  const std::vector<std::string> known = robot.joint_names();
  JointBinding binding;
  for (const std::string& name : names) {
    const auto it = std::ranges::find(known, name);
    binding.indices.push_back(it == known.end() ? -1 : static_cast<int>(it - known.begin()));
    if (it == known.end()) binding.absent.push_back(name);
  }
  for (const std::string& name : known)
    if (std::ranges::find(names, name) == names.end()) binding.unnamed.push_back(name);
  return binding;
}

}  // namespace duet
