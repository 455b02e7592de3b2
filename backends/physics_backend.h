// The common part of the adapters of physics engines: the moving partner, pushes, the points where the robot touches,
// and the order of a snapshot. An engine adds how it is placed, advanced and stored.
#pragma once

#include <Eigen/Core>
#include <span>
#include <vector>

#include "duet/backends/backend.h"
#include "duet/backends/narrow_phase.h"
#include "duet/core/robot_state.h"
#include "duet/robots/dynamics.h"
#include "duet/robots/kinematics.h"

namespace duet {

// The forces of Backend::push: each keeps its direction in W and acts at a point fixed to its link.
class ExternalForces {
 public:
  struct Push {
    Eigen::Vector3d f_W = Eigen::Vector3d::Zero();
    Eigen::Vector3d p_L = Eigen::Vector3d::Zero();
  };

  explicit ExternalForces(std::size_t links) : pushes_(links) {}

  void clear();
  void set(int link, const Eigen::Vector3d& f_W, const Eigen::Vector3d& p_L);
  [[nodiscard]] bool any() const { return any_; }
  [[nodiscard]] std::span<const Push> all() const { return pushes_; }  // one per link

  // For snapshots: size() numbers, appended or read back.
  [[nodiscard]] std::size_t size() const { return 1 + 6 * pushes_.size(); }
  void append_to(std::vector<double>& values) const;
  void read_from(std::span<const double> values);

 private:
  std::vector<Push> pushes_;
  bool any_ = false;  // since the last clear
};

class PhysicsBackend : public Backend {
 protected:
  // Throws what Backend does.
  explicit PhysicsBackend(const Scene& scene);

  MovingPartner partner_;
  ExternalForces pushes_;
  NarrowPhase narrow_phase_;

 private:
  virtual void place() = 0;  // the engine's state from state_, nothing left of an earlier run
  virtual Outcome advance(const JointCommand& command) = 0;       // state_, contacts_ and torques_ after one step
  virtual void append_to(std::vector<double>& values) const = 0;  // what a bitwise continuation needs beyond state_
  virtual void read_from(std::span<const double> values) = 0;     // the same number of values, state_ already read

  void do_reset() final;
  void do_set_partner(const HumanJoints& joints, const HumanJoints& velocities) final;
  Outcome do_step(const JointCommand& command) final;
  void do_push(int link, const Eigen::Vector3d& f_W, const Eigen::Vector3d& p_W) final;
  void do_snapshot(Snapshot& snapshot) const final;
  void do_restore(std::span<const double> values) final;

  Kinematics kinematics_;  // of state_, where a push is set
};

// The CPU clock of the calling thread, which times a step.
double thread_cpu_seconds();  // since the thread began [s]

// The torque law of JointCommand as one linearly implicit step, for engines that have no joint law of their own. With
// the mass matrix M and bias b, of our own model or the engine's, and a generalised force Q from outside:
//   (M + S) a = t0 - b + Q,   s = armature + dt kd + dt^2 kp,   t0 = kp (q* - q - dt v) - kd v + tau_ff.
// The law's torque is u = t0 - (s - armature) a. Where |u| exceeds the effort, t0 becomes the effort and s the
// armature, and the step is solved once more: the limit holds for PD and feed-forward together, armature apart. First
// order in dt, as the engines' own steps. No allocation after construction.
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
  [[nodiscard]] const TreeFactor& factor() const { return factor_; }         // of M + S
  [[nodiscard]] const Eigen::VectorXd& acceleration() const { return a_; }   // of solve(), (6 + dof)
  [[nodiscard]] const Eigen::VectorXd& inertia() const { return inertia_; }  // s: armature + dt kd + dt^2 kp [kg m^2]
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
