// The reference that the suite compares engines with: our own dynamics (robots/dynamics.h) integrated by Runge-Kutta,
// and the momentum and energy of a state. Internal to backends/conformance.
#pragma once

#include <Eigen/Core>

#include "duet/core/random.h"
#include "duet/robots/dynamics.h"

namespace duet::conformance {

// Random orientation and joint positions within `share` of their ranges about the middle; base and joint velocities of
// standard deviation `speed` [m/s, rad/s].
RobotState random_state(const RobotModel& robot, const Eigen::Vector3d& p_WB, double share, double speed,
                        Random& random);

// Generalised acceleration under the generalised force Q (6 + dof, robots/kinematics.h), armature included.
Eigen::VectorXd acceleration(Dynamics& dynamics, const RobotState& state, const Eigen::VectorXd& Q);

// Classical fourth-order Runge-Kutta under a constant generalised force.
RobotState integrate(const RobotModel& robot, const Eigen::Vector3d& gravity_W, const RobotState& start,
                     const Eigen::VectorXd& Q, double seconds, double dt);

struct Momentum {
  Eigen::Vector3d linear = Eigen::Vector3d::Zero();   // [kg m/s], W
  Eigen::Vector3d angular = Eigen::Vector3d::Zero();  // about the centre of mass [kg m^2/s], W
};
Momentum momentum_of(const RobotModel& robot, const RobotState& state);

// Kinetic energy of the links other than the base, and their potential energy above the base: a heavy base that gives
// way by centimetres in a minute does not count. [J]
double energy_above_base(const RobotModel& robot, const RobotState& state, double gravity);

double largest_joint_error(const RobotState& a, const RobotState& b);  // [rad]

}  // namespace duet::conformance
