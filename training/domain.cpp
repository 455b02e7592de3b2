#include "duet/training/domain.h"

namespace duet {

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

}  // namespace duet
