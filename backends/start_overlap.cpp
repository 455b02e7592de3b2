#include "duet/backends/start_overlap.h"

#include <fmt/format.h>

#include <algorithm>

#include "duet/backends/narrow_phase.h"
#include "duet/core/require.h"

namespace duet {
namespace {

ContactPoint deepest(const Scene& scene, const RobotState& state, const MovingPartner& partner, bool with_human) {
  Kinematics kinematics(*scene.robot);
  kinematics.update(state.X_WB, state.q);
  NarrowPhase narrow_phase(scene, scene.robot->shapes.size() * scene.human.capsules.size());
  ContactPoint found;
  for (const ContactPoint& point : narrow_phase.collide(kinematics, partner))
    if ((point.side == ContactSide::kHuman) == with_human && point.depth > found.depth) found = point;
  return found;
}

}  // namespace

void refuse_robot_overlap(const Scene& scene, const RobotState& state) {
  const ContactPoint point = deepest(scene, state, {}, false);
  if (point.depth <= kRobotOverlap) return;
  const std::vector<RobotLink>& links = scene.robot->links;
  if (point.side == ContactSide::kGround)
    throw std::invalid_argument(
        fmt::format("Backend::reset: {} is {:.3f} m below the ground", links[point.link].name, point.depth));
  throw std::invalid_argument(fmt::format("Backend::reset: {} and {} overlap by {:.3f} m", links[point.link].name,
                                          links[point.other].name, point.depth));
}

void refuse_partner_overlap(const Scene& scene, const RobotState& state, const HumanJoints& joints) {
  if (scene.partner != PartnerMode::kSolid) return;
  MovingPartner partner;
  partner.set(joints, HumanJoints::Zero());
  const ContactPoint point = deepest(scene, state, partner, true);
  if (point.depth <= kPartnerOverlap) return;
  throw std::invalid_argument(
      fmt::format("Backend::set_partner: {} (region {}) of the partner and {} overlap by {:.3f} m",
                  scene.human.capsules[point.other].name, scene.human.capsules[point.other].region,
                  scene.robot->links[point.link].name, point.depth));
}

}  // namespace duet
