// The torque law of JointCommand as one linearly implicit step, for engines that have no joint law of their own. With
// the mass matrix M and bias b of our own model and a generalised force Q from outside:
//   (M + S) a = t0 - b + Q,   s = armature + dt kd + dt^2 kp,   t0 = kp (q* - q - dt v) - kd v + tau_ff.
// The law's torque is u = t0 - (s - armature) a. Where |u| exceeds the effort, t0 becomes the effort and s the
// armature, and the step is solved once more: the limit holds for PD and feed-forward together, armature apart. First
// order in dt, as the engines' own steps. reference/engines.md section 10. No allocation after construction.
#pragma once

#include <Eigen/Core>

#include "backends/scene.h"
#include "core/robot_state.h"
#include "robots/dynamics.h"
#include "robots/tree_factor.h"

namespace duet {

class ImplicitLaw {
 public:
  explicit ImplicitLaw(const Scene& scene);  // keeps the robot model alive

  // Model of `state`, law of `command`, without the limit; factors M + S. Throws std::runtime_error where M + S is not
  // positive definite (a state that has diverged).
  void begin(const RobotState& state, const JointCommand& command);
  // The same on an engine's own mass matrix (without armature) and bias forces, in the layout of robots/kinematics.h;
  // both must live until the step is over. dynamics() and kinematics() are not updated.
  void begin(const RobotState& state, const JointCommand& command, const Eigen::MatrixXd& mass,
             const Eigen::VectorXd& bias);
  // Accelerations under `Q` (6 + dof), the limit applied where it is passed. Q = 0: no contact.
  void solve(const Eigen::VectorXd& Q);
  // Takes the limit where acceleration() passes it and factors again; true where that changed anything. For adapters
  // that find the acceleration themselves (with contacts) and then repeat it.
  bool saturate(const Eigen::VectorXd& a);

  [[nodiscard]] const Dynamics& dynamics() const { return dynamics_; }
  [[nodiscard]] const Kinematics& kinematics() const { return dynamics_.kinematics(); }
  [[nodiscard]] const TreeFactor& factor() const { return factor_; }               // of M + S
  [[nodiscard]] const Eigen::VectorXd& drive() const { return drive_; }            // t0, (dof) [N m]
  [[nodiscard]] const Eigen::VectorXd& added_inertia() const { return inertia_; }  // s, (dof) [kg m^2]
  [[nodiscard]] const Eigen::VectorXd& acceleration() const { return a_; }         // (6 + dof)
  // Q + t0 - b, the right-hand side for a force Q.
  void forces(const Eigen::VectorXd& Q, Eigen::VectorXd& out) const;
  // What an engine that knows only M must apply so that it reaches the acceleration `a`: t0 - s a. [N m]
  void equivalent_torques(const Eigen::VectorXd& a, Eigen::VectorXd& out) const;
  // The law's torque u, armature apart: what Backend::torques() reports. [N m]
  void torques(const Eigen::VectorXd& a, Eigen::VectorXd& out) const;

 private:
  void factorise();

  std::shared_ptr<const RobotModel> robot_;
  double dt_;
  Dynamics dynamics_;
  const Eigen::MatrixXd* mass_;
  const Eigen::VectorXd* bias_;
  TreeFactor factor_;
  Eigen::VectorXd drive_, inertia_, a_;
};

}  // namespace duet
