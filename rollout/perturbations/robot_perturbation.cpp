#include "duet/rollout/perturbations/robot_perturbation.h"

namespace duet {

int perturbed_link(const std::string& name, const RobotModel& robot) {
  return robot.frames[robot.frame_index(named_link(name, robot))].link;
}

std::string named_link(const std::string& name, const RobotModel& robot) {
  return name.empty() ? robot.frames[robot.roles.push_frame].name : name;
}

}  // namespace duet
