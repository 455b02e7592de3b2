// The robot as a btMultiBody. Bullet's frame of a link lies at its centre of mass along its principal axes; joints keep
// the card's order. Bullet's generalised velocity is [w (W), velocity of the base's centre of mass (W), qd].
#pragma once

#include <BulletDynamics/Featherstone/btMultiBody.h>
#include <BulletDynamics/Featherstone/btMultiBodyConstraintSolver.h>

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <memory>
#include <span>
#include <vector>

#include "duet/backends/backend.h"
#include "duet/backends/narrow_phase.h"
#include "duet/core/robot_state.h"
#include "duet/robots/dynamics.h"
#include "duet/robots/kinematics.h"

namespace duet {

class Articulation {
 public:
  explicit Articulation(const Scene& scene);

  [[nodiscard]] btMultiBody& body() { return *body_; }
  [[nodiscard]] int size() const { return 6 + robot_->dof(); }  // of the generalised velocity
  [[nodiscard]] Eigen::Map<const Eigen::VectorXd> velocity() const { return {body_->getVelocityVector(), size()}; }
  void set_velocity(const Eigen::VectorXd& velocity);

  void write(const RobotState& state);
  void kick(const Eigen::Vector3d& dv_W);  // adds to the base's velocity
  void read(RobotState& state) const;

  // Bullet's articulated-body algorithm: velocity() after dt under gravity and the generalised force `Q` alone (of
  // duet's generalised velocity, robots/kinematics.h). R_WB: of the state.
  void accelerate(const Eigen::VectorXd& Q, const Eigen::Matrix3d& R_WB, double dt);
  void integrate(double dt) { body_->stepPositionsMultiDof(dt); }  // positions, with velocity()

  // The state as Bullet stores it, without the rounding of write() and read().
  void append_to(std::vector<double>& values) const;
  void read_from(std::span<const double> values);

 private:
  std::shared_ptr<const RobotModel> robot_;
  btVector3 gravity_;
  Eigen::Quaterniond R_BP_;  // principal axes of the base
  std::unique_ptr<btMultiBody> body_;
  btAlignedObjectArray<btScalar> scratch_r_;
  btAlignedObjectArray<btVector3> scratch_v_;
  btAlignedObjectArray<btMatrix3x3> scratch_m_;
};

// Bullet's sequential impulses for one articulation whose joints also have the inertia S of the torque law
// (backends/physics_backend.h). The rows of contacts and joint stops are made here, not from manifolds and constraints,
// so that their response is (M + S)^-1 J^T; Bullet solves them. No history: equal input, equal impulses.

struct RowSettings {
  int iterations = 20;
  double erp = 0.2;       // share of a rigid contact's depth beyond `slop` that one step removes
  double push_out = 0.1;  // the most speed at which it does so [m/s]
  double slop = 1e-5;     // depth at which a rigid contact rests [m]
  double stop_erp = 0.2;  // share of a stop's violation that one step removes
};

class RowSolver final : public btMultiBodyConstraintSolver {
 public:
  // `contacts`: the most that one step has.
  RowSolver(const Scene& scene, const RowSettings& settings, std::size_t contacts);

  // Jacobians and targets of the touching points, of this state.
  void set_contacts(std::span<const ContactPoint> points, const Kinematics& kinematics);
  // Adds to the velocity of `articulation` what contacts and stops change in this step. `q`: its joints before it.
  void solve(Articulation& articulation, const TreeFactor& factor, const Kinematics& kinematics,
             const Eigen::VectorXd& q);
  // The force of the other side on the link of point i, mean over the step. [N], frame W.
  [[nodiscard]] Eigen::Vector3d contact_force(std::size_t i) const;

 private:
  using Triple = TreeFactor::Triple;
  struct ContactRows {
    std::vector<int> support;  // entries of the generalised velocity that J depends on, falling
    Triple J;                  // normal, two tangents; in duet's generalised velocity
    Eigen::Matrix3d axes_W = Eigen::Matrix3d::Identity();  // columns: normal, tangents
    Eigen::Vector3d v_target = Eigen::Vector3d::Zero();    // along them [m/s]
    double cfm = 0.0, friction = 0.0;
  };

  btScalar solveGroupCacheFriendlySetup(btCollisionObject** bodies, int bodies_size, btPersistentManifold** manifolds,
                                        int manifolds_size, btTypedConstraint** constraints, int constraints_size,
                                        const btContactSolverInfo& info, btIDebugDraw* draw) override;
  // Nothing is written back: impulses are read from the rows.
  btScalar solveGroupCacheFriendlyFinish(btCollisionObject**, int, const btContactSolverInfo&) override { return 0.0; }

  void add_link(ContactRows& rows, int link, double sign, const Eigen::Vector3d& p_W,
                const Kinematics& kinematics) const;
  void add_stops();
  void add_contact(const ContactRows& contact);
  // A row of the Jacobian row_ and the response_ to its unit impulse, both in duet's generalised velocity.
  btMultiBodySolverConstraint& add_row(btMultiBodyConstraintArray& rows, double cfm, double v_target);

  std::shared_ptr<const RobotModel> robot_;
  RowSettings settings_;
  double dt_;
  btContactSolverInfo info_;
  std::vector<ContactRows> contacts_;  // the first `used_` count
  std::size_t used_ = 0;

  // Inputs of the step that is being solved.
  Articulation* articulation_ = nullptr;
  const TreeFactor* factor_ = nullptr;
  const Eigen::VectorXd* q_ = nullptr;
  Eigen::Matrix3d R_WB_ = Eigen::Matrix3d::Identity();
  Eigen::Vector3d r_W_ = Eigen::Vector3d::Zero();  // from the base's origin to its centre of mass
  Triple responses_;
  Eigen::VectorXd row_, response_;
};

}  // namespace duet
