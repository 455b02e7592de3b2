// The human in MuJoCo's constraint rows: what mj_step1 leaves there for a resting body with MuJoCo's own softness
// becomes the skin of the capsule that touches, moving as the partner moves.
#pragma once

#include "duet/backends/mujoco/mujoco_model.h"
#include "duet/backends/partner.h"
#include "duet/backends/scene.h"

namespace duet {

// Between mj_step1 and the solver. With normal gap r and velocity v (apart positive) the row becomes
//   f = -K r - (D + dt K) v - (dt D + dt^2 K) a,
// spring and damper of the capsule's skin taken linearly implicitly, shared by the points of one pair of bodies.
// Friction rows keep their ratio to the normal and hold the partner's velocity.
void set_skin_rows(const Scene& scene, const MovingPartner& partner, const MujocoModel& compiled);

}  // namespace duet
