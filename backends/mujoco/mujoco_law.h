// The torque law of JointCommand in MuJoCo, as ImplicitLaw has it: (M + S) a = t0 - b + J^T f. The law's addition to
// the inertia of a joint, dt kd + dt^2 kp, stands beside the armature in MuJoCo's mass matrix; so the constraint solver
// sees M + S and the integrator has nothing left to do. No allocation after construction.
#pragma once

#include <Eigen/Core>

#include "duet/backends/backend.h"
#include "duet/backends/mujoco/mujoco_model.h"
#include "duet/backends/narrow_phase.h"
#include "duet/core/robot_state.h"

namespace duet {

class MujocoLaw {
 public:
  MujocoLaw(const Scene& scene, const MujocoModel& compiled);  // keeps references to both

  // Inertia and torque of the step, without the limit. Before mj_step1.
  void begin(const RobotState& state, const JointCommand& command);
  // Accelerations and constraint forces (mj_fwdAcceleration, mj_fwdConstraint), repeated once where a joint passes its
  // limit: that joint then gets its effort and its armature alone. Between mj_step1 and integrate().
  void accelerate();
  // The state after the step.
  void integrate();
  // The law's torque, armature apart, for the velocities before and after the step. [N m]
  void torques(const Eigen::VectorXd& v_before, const Eigen::VectorXd& v_after, Eigen::VectorXd& out) const;

 private:
  bool saturate();

  const Scene& scene_;
  const MujocoModel& compiled_;
  Eigen::VectorXd drive_, added_;  // t0; dt kd + dt^2 kp
};

// The human in MuJoCo's constraint rows: what mj_step1 leaves there for a resting body with MuJoCo's own softness
// becomes the skin of the capsule that touches, moving as the partner moves.

// Between mj_step1 and the solver. With normal gap r and velocity v (apart positive) the row becomes
//   f = -K r - (D + dt K) v - (dt D + dt^2 K) a,
// spring and damper of the capsule's skin taken linearly implicitly, shared by the points of one pair of bodies.
// Friction rows keep their ratio to the normal and hold the partner's velocity.
void set_skin_rows(const Scene& scene, const MovingPartner& partner, const MujocoModel& compiled);

}  // namespace duet
