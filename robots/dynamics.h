// Rigid-body dynamics of a RobotModel: recursive Newton-Euler and the joint-space mass matrix, in the generalised
// velocity of robots/kinematics.h. Source: Featherstone, Rigid Body Dynamics Algorithms, chapters 5, 6 and 9.
#pragma once

#include <Eigen/Core>

#include "robots/kinematics.h"

namespace duet {

inline constexpr double kGravity = 9.81;  // [m/s^2], along -z of W

// Generalised forces that give zero generalised acceleration: Coriolis, centrifugal and gravity terms, (6 + dof).
// [N] for the base's translation (W), [N m] for its rotation (B) and the joints. Armature does not enter.
void bias_forces(const RobotModel& model, const RobotState& state, Eigen::Ref<Eigen::VectorXd> out);

// Inverse dynamics: generalised forces for the acceleration `a` (same layout), bias included.
void inverse_dynamics(const RobotModel& model, const RobotState& state, const Eigen::VectorXd& a,
                      Eigen::Ref<Eigen::VectorXd> out);

// (6 + dof) x (6 + dof), symmetric; armature on the diagonal of the joints.
void mass_matrix(const RobotModel& model, const RobotState& state, Eigen::Ref<Eigen::MatrixXd> out);

}  // namespace duet
