#include "duet/training/mirror.h"

#include <algorithm>

#include "duet/controllers/wbc_sim/observation.h"
#include "duet/core/require.h"
#include "duet/robots/roles.h"

namespace duet {
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
