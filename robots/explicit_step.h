// The largest physics step at which the explicit torque law (backends/backend.h) holds a robot's joints without shaking
// them: foretold from the mass matrix, without a simulation. Pure functions.
#pragma once

#include <Eigen/Core>

#include "duet/core/robot_state.h"
#include "duet/robots/robot_model.h"

namespace duet {

struct JointGains {
  Eigen::VectorXd kp, kd;  // one per joint [N m/rad], [N m s/rad]
};

struct ExplicitStep {
  double largest = 0.0;  // [s]; infinite where no joint has gains
  int joint = -1;        // with the largest part in what first does not decay, of a pair the first; -1: none
};

// About `pose`, with the base free and no contact, a step of the explicit law is v+ = v - dt W (K q + D v) and
// q+ = q + dt v+, where W are the joints' rows and columns of the inverse mass matrix, armature included. All
// oscillations decay where 2 dt D + dt^2 K is less than 4 W^-1 in every direction; where it is equal one of them flips
// its sign from step to step for ever. Of one joint of inertia I: 2 dt kd + dt^2 kp = 4 I. Exact for small motions;
// feet on the ground make the legs heavier, so a step above it may hold there. Throws std::invalid_argument for gains
// of another robot's size.
ExplicitStep largest_explicit_step(const RobotModel& robot, const RobotState& pose, const JointGains& gains);

// The same at one joint that alone is held: I_j = 1 / (M^-1)_jj.
double largest_explicit_step_of(const RobotModel& robot, const RobotState& pose, const JointGains& gains, int joint);

// The gains with damping lowered, by a twentieth at a time at the joint that oscillates first and at its counterpart,
// until the explicit law bears twice `step` on the robot without armature: then what oscillates at `step` decays. No kp
// changes, and no kd that the law bears. Throws std::invalid_argument for a step that is not positive, for gains of
// another robot's size, and where kp alone is too stiff for it, naming the joint.
JointGains gains_for_explicit_step(RobotModel robot, JointGains gains, double step);

}  // namespace duet
