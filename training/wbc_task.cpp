#include "duet/training/wbc_task.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "duet/controllers/stance.h"
#include "duet/controllers/wbc_sim/observation.h"
#include "duet/core/named_table.h"
#include "duet/core/require.h"
#include "duet/robots/roles.h"

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

WbcTask wbc_stage(const std::string& name) { return entry_named(kStages, "stage", name).make(); }

Eigen::VectorXd action_scale(const RobotModel& robot) {
  Eigen::VectorXd scale = Eigen::VectorXd::Constant(robot.dof(), kUpperScale);
  const Stance stance(robot);
  for (const Leg& leg : stance.legs())
    for (const int joint : leg.joints) scale[joint] = kLegScale;
  return scale;
}

double lift_cost(double above) { return std::pow(std::min(0.0, above), 2) + 0.3 * std::pow(std::max(0.0, above), 2); }

std::shared_ptr<const RobotModel> draw_body(const RobotModel& nominal, const DomainOptions& options, Random& random) {
  auto body = std::make_shared<RobotModel>(nominal);
  RobotLink& torso = body->links[nominal.frames[nominal.track_frame("torso")].link];
  const double before = torso.mass;
  torso.mass += random.uniform(options.torso_mass_low, options.torso_mass_high);
  torso.inertia *= torso.mass / before;
  for (int axis = 0; axis < 3; ++axis) torso.com[axis] += random.uniform(-options.torso_com, options.torso_com);
  const double scale = random.uniform(1.0 - options.mass_scale, 1.0 + options.mass_scale);
  for (RobotLink& link : body->links) {
    link.mass *= scale;
    link.inertia *= scale;
  }
  return body;
}

namespace {

Mirror vector_mirror() { return {.from = {0, 1, 2}, .sign = {1.0F, -1.0F, 1.0F}}; }  // a position or velocity
Mirror axial_mirror() { return {.from = {0, 1, 2}, .sign = {-1.0F, 1.0F, -1.0F}}; }  // an angular velocity
Mirror columns_mirror() {                                                            // two columns of a rotation
  return {.from = {0, 1, 2, 3, 4, 5}, .sign = {1.0F, -1.0F, 1.0F, -1.0F, 1.0F, -1.0F}};
}

// The mirror of one channel of WBC-Sim's; `joints` is that of every channel with a number for each joint.
Mirror mirror_of(ChannelKind kind, const Mirror& joints) {
  switch (kind) {
    case ChannelKind::kBaseAngularVelocity:
      return axial_mirror();
    case ChannelKind::kBaseLinearVelocity:
    case ChannelKind::kGravity:
    case ChannelKind::kRootPositionError:
      return vector_mirror();
    case ChannelKind::kRootOrientationError:
      return columns_mirror();
    default:
      return joints;
  }
}

void add(Mirror& mirror, const Mirror& block) { mirror.append(block, mirror.size()); }

}  // namespace

void Mirror::append(const Mirror& block, int offset) {
  for (int i = 0; i < block.size(); ++i) {
    from.push_back(offset + block.from[i]);
    sign.push_back(block.sign[i]);
  }
}

void Mirror::apply(std::span<const float> x, std::span<float> y) const {
  for (size_t i = 0; i < from.size(); ++i) y[i] = sign[i] * x[from[i]];
}

Mirror mirror_joints(const RobotModel& robot) {
  Mirror mirror;
  for (int joint = 0; joint < robot.dof(); ++joint) {
    mirror.from.push_back(robot.roles.counterpart[joint]);
    mirror.sign.push_back(static_cast<float>(mirror_sign(robot, joint)));
  }
  return mirror;
}

Mirror mirror_actor(const RobotModel& robot) {
  const Mirror joints = mirror_joints(robot);
  Mirror mirror;
  for (const ChannelGroup& group : wbc_observation(WbcKind::kOracle).groups)
    for (const Channel& channel : group.channels) add(mirror, mirror_of(channel.kind, joints));
  return mirror;
}

Mirror mirror_critic(const RobotModel& robot, const std::vector<int>& links) {
  Mirror mirror = mirror_actor(robot);
  const int begin = mirror.size();
  Mirror body = vector_mirror();
  body.append(columns_mirror(), 3);
  for (const int link : links) {
    const int wanted = link == 0 ? 0 : robot.roles.counterpart[link - 1] + 1;
    const auto other = std::ranges::find(links, wanted);
    require(other != links.end(), "mirror: link '{}' has no counterpart '{}'", robot.links[link].name,
            robot.links[wanted].name);
    mirror.append(body, begin + 9 * static_cast<int>(other - links.begin()));
  }
  return mirror;
}

}  // namespace duet
