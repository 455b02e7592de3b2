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

// Pushes, kicks and a reference that moves twice as fast and jumps; feet step as soon as the capture point is off.
WbcTask brace() {
  WbcTask task = walk();
  task.name = "brace";
  task.gait.lead_time = 0.42;
  task.gait.capture_time = kPendulumTime;
  task.gait.max_speed = 1.0;
  task.stream.moving = 0.5;
  task.stream.max_speed = 0.8;
  task.largest_std = 0.35;
  task.farthest = 2.0;
  task.domain.kick = 1.1;
  task.domain.push = 75.0;
  task.domain.push_share = 0.5;
  task.domain.push_pause = 2.5;
  task.domain.jump = 0.02;
  task.domain.jump_turn = 0.03;
  task.domain.jump_share = 0.3;
  task.domain.latency = 1;
  task.reward.foothold = 4.0;
  task.reward.foothold_width = 0.2;
  task.reward.root_xy_width = 0.15;
  task.reward.root_near = 5.0;
  task.reward.root_near_width = 0.08;
  task.reward.height = 2.0;
  task.reward.height_width = 0.025;
  task.reward.action_rate = 0.12;
  task.reward.action_jerk = 0.045;
  return task;
}

// The same and motions of people, later commands and quieter actions.
WbcTask interact() {
  WbcTask task = brace();
  task.name = "interact";
  task.largest_std = 0.25;
  task.stream.motions = 0.2;
  task.stream.moving = 0.6;
  task.domain.latency = 2;
  task.entropy = 0.0;
  task.reward.root_near_width = 0.06;
  task.reward.action_rate = 0.4;
  task.reward.action_jerk = 0.15;
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
