// An episode that begins with bodies inside one another would be thrown apart: refused by name in every engine alike.
// A light touch at the start (soles, a hand on a shoulder) is allowed.
#pragma once

#include "duet/backends/partner.h"
#include "duet/backends/scene.h"
#include "duet/core/robot_state.h"

namespace duet {

inline constexpr double kRobotOverlap = 0.03;    // of a declared pair, or of a link with the ground [m]
inline constexpr double kPartnerOverlap = 0.10;  // of a link with a capsule of the solid partner [m]

// For Backend::reset. Throws std::invalid_argument naming the deepest overlap beyond kRobotOverlap.
void refuse_robot_overlap(const Scene& scene, const RobotState& state);
// For the first Backend::set_partner after a reset: the same for the solid partner and kPartnerOverlap. A partner of
// another mode is never refused.
void refuse_partner_overlap(const Scene& scene, const RobotState& state, const HumanJoints& joints);

}  // namespace duet
