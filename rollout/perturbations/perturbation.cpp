#include "duet/rollout/perturbations/perturbation.h"

#include <fmt/format.h>

#include <utility>

namespace duet {

Perturbation with_links(Perturbation perturbation, const RobotModel& robot) {
  for (std::shared_ptr<const RobotPerturbation>& one : perturbation.robot)
    if (std::shared_ptr<const RobotPerturbation> named = one->with_links(robot)) one = std::move(named);
  return perturbation;
}

void check_perturbation(const Perturbation& perturbation, const RobotModel& robot) {
  try {
    for (const std::shared_ptr<const RobotPerturbation>& one : perturbation.robot) one->check(robot);
  } catch (const std::invalid_argument& error) {
    throw std::invalid_argument(
        fmt::format("perturbation '{}' on robot '{}': {}", perturbation.name, robot.name, error.what()));
  }
}

std::shared_ptr<const RobotModel> perturbed_robot(const Perturbation& perturbation,
                                                  const std::shared_ptr<const RobotModel>& robot) {
  std::shared_ptr<const RobotModel> changed = robot;
  for (const std::shared_ptr<const RobotPerturbation>& one : perturbation.robot) changed = one->changed(changed);
  return changed;
}

}  // namespace duet
