#include "duet/training/wbc_task.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "duet/controllers/stance.h"
#include "duet/core/names.h"

namespace duet {
namespace {

WbcTask stand() {
  WbcTask task;
  task.name = "stand";
  return task;
}

WbcTask walk() {
  WbcTask task;
  task.name = "walk";
  task.stream.moving = 0.75;
  task.stream.crouch = 0.2;
  task.stream.bow = 0.1;
  task.domain.kick = 0.8;
  task.reward.root_near = 4.0;
  task.reward.root_near_width = 0.08;
  task.reward.height_width = 0.03;
  task.reward.clock = 2.5;
  task.reward.lift = 300.0;
  task.reward.action_rate = 0.05;
  task.reward.action_jerk = 0.02;
  task.entropy = 0.0005;
  return task;
}

// Half the pushes of `interact`: what is pushed hard at once learns slowly.
WbcTask brace() {
  WbcTask task = walk();
  task.name = "brace";
  task.stream.moving = 0.5;
  task.domain.push = 55.0;
  task.domain.latency = 1;
  return task;
}

WbcTask interact() {
  WbcTask task = brace();
  task.name = "interact";
  task.stream.motions = 0.3;
  task.stream.moving = 0.6;
  task.domain.kick = 1.0;
  task.domain.push = 75.0;
  task.domain.latency = 2;
  task.entropy = 0.0;
  task.reward.action_rate = 0.1;
  task.reward.action_jerk = 0.03;
  return task;
}

struct Entry {
  const char* name;
  WbcTask (*make)();
};

constexpr Entry kStages[] = {{"stand", stand}, {"walk", walk}, {"brace", brace}, {"interact", interact}};

}  // namespace

std::vector<std::string> wbc_stages() {
  std::vector<std::string> names;
  for (const Entry& entry : kStages) names.emplace_back(entry.name);
  return names;
}

WbcTask wbc_stage(const std::string& name) {
  for (const Entry& entry : kStages)
    if (name == entry.name) return entry.make();
  throw std::invalid_argument(unknown_name_message("stage", name, wbc_stages()));
}

Eigen::VectorXd action_scale(const RobotModel& robot) {
  Eigen::VectorXd scale = Eigen::VectorXd::Constant(robot.dof(), kUpperScale);
  const Stance stance(robot);
  for (const Leg& leg : stance.legs())
    for (const int joint : leg.joints) scale[joint] = kLegScale;
  return scale;
}

double lift_cost(double above) { return std::pow(std::min(0.0, above), 2) + 0.3 * std::pow(std::max(0.0, above), 2); }

}  // namespace duet
