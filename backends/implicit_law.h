// The torque law of JointCommand as one linearly implicit step, for engines that have no joint law of their own. With
// the mass matrix M and bias b, of our own model or the engine's, and a generalised force Q from outside:
//   (M + S) a = t0 - b + Q,   s = armature + dt kd + dt^2 kp,   t0 = kp (q* - q - dt v) - kd v + tau_ff.
// The law's torque is u = t0 - (s - armature) a. Where |u| exceeds the effort, t0 becomes the effort and s the
// armature, and the step is solved once more: the limit holds for PD and feed-forward together, armature apart. First
// order in dt, as the engines' own steps. No allocation after construction.
#pragma once

#include <Eigen/Core>

#include "duet/backends/scene.h"
#include "duet/core/robot_state.h"
#include "duet/robots/dynamics.h"
#include "duet/robots/tree_factor.h"

namespace duet {

class ImplicitLaw {
 public:
  explicit ImplicitLaw(const Scene& scene);  // keeps the robot model alive

  // Model of `state`, law of `command`, without the limit; factors M + S. False where that is not positive definite:
  // the state has diverged, and the rest of the step must not be asked for.
  [[nodiscard]] bool begin(const RobotState& state, const JointCommand& command);
  // The same on an engine's own mass matrix (without armature) and bias forces, in the layout of robots/kinematics.h;
  // both must live until the step is over. kinematics() is not updated.
  [[nodiscard]] bool begin(const RobotState& state, const JointCommand& command, const Eigen::MatrixXd& mass,
                           const Eigen::VectorXd& bias);
  // Accelerations under `Q` (6 + dof), the limit applied where it is passed. Q = 0: no contact.
  void solve(const Eigen::VectorXd& Q);
  // Takes the limit where the acceleration `a` passes it and factors again; true where that changed anything. For
  // adapters that find the acceleration themselves (with contacts) and then repeat it. Throws std::runtime_error where
  // M plus armature is not positive definite.
  bool saturate(const Eigen::VectorXd& a);

  [[nodiscard]] const Kinematics& kinematics() const { return dynamics_.kinematics(); }
  [[nodiscard]] const TreeFactor& factor() const { return factor_; }        // of M + S
  [[nodiscard]] const Eigen::VectorXd& acceleration() const { return a_; }  // of solve(), (6 + dof)
  // Q + t0 - b, the right-hand side for a force Q.
  void forces(const Eigen::VectorXd& Q, Eigen::VectorXd& out) const;
  // The torques by which an engine that knows only M reaches the acceleration `a`: t0 - s a. [N m]
  void equivalent_torques(const Eigen::VectorXd& a, Eigen::VectorXd& out) const;
  // The law's torque u, armature apart: what Backend::torques() reports. [N m]
  void torques(const Eigen::VectorXd& a, Eigen::VectorXd& out) const;

 private:
  std::shared_ptr<const RobotModel> robot_;
  double dt_;
  Dynamics dynamics_;
  const Eigen::MatrixXd* mass_;
  const Eigen::VectorXd* bias_;
  TreeFactor factor_;
  Eigen::VectorXd drive_, inertia_, a_;  // t0 [N m], s [kg m^2], acceleration of solve()
};

}  // namespace duet
