#include "duet/rollout/perturbation.h"

#include <fmt/format.h>

#include "duet/core/require.h"

namespace duet {

int perturbed_link(const std::string& name, const RobotModel& robot) {
  return robot.frames[name.empty() ? robot.roles.push_frame : robot.frame_index(name)].link;
}

Perturbation with_links(Perturbation perturbation, const RobotModel& robot) {
  const std::string& link = robot.frames[robot.roles.push_frame].name;
  if (perturbation.push && perturbation.push->link.empty()) perturbation.push->link = link;
  if (perturbation.mass && perturbation.mass->link.empty()) perturbation.mass->link = link;
  return perturbation;
}

void check_perturbation(const Perturbation& perturbation, const RobotModel& robot) {
  try {
    if (perturbation.push) static_cast<void>(perturbed_link(perturbation.push->link, robot));
    if (perturbation.mass) static_cast<void>(perturbed_robot(perturbation, std::make_shared<RobotModel>(robot)));
  } catch (const std::invalid_argument& error) {
    throw std::invalid_argument(
        fmt::format("perturbation '{}' on robot '{}': {}", perturbation.name, robot.name, error.what()));
  }
}

std::shared_ptr<const RobotModel> perturbed_robot(const Perturbation& perturbation,
                                                  const std::shared_ptr<const RobotModel>& robot) {
  if (!perturbation.mass) return robot;
  auto heavier = std::make_shared<RobotModel>(*robot);
  RobotLink& link = heavier->links[perturbed_link(perturbation.mass->link, *robot)];
  require(link.mass + perturbation.mass->add > 0.0,
          fmt::format("link '{}' has {:.3f} kg: expected some to be left, found {:g} kg added", link.name, link.mass,
                      perturbation.mass->add));
  link.mass += perturbation.mass->add;
  return heavier;
}

}  // namespace duet
