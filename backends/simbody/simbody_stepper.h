// One step around Simbody's dynamics: the torque law (backends/physics_backend.h) and contacts
// (backends/contact_solver.h) on Simbody's mass matrix and bias, then semi-implicit Euler. A function of the state
// alone.
#pragma once

#include <Eigen/Core>
#include <span>

#include "duet/backends/contact_solver.h"
#include "duet/backends/engine_module.h"
#include "duet/backends/narrow_phase.h"
#include "duet/backends/physics_backend.h"
#include "duet/backends/simbody/simbody_model.h"

namespace duet {

// The settings of the step around Simbody that a profile may change.

struct SimbodySettings {
  double contact_stiffness = 0.0;  // of a rigid contact point [N/m]
  double contact_damping = 0.0;    // [N s/m]
  double stop_erp = 0.0;
  int sweeps = 0;
};

std::span<const EngineOption> simbody_options();
// Throws std::invalid_argument as check_options.
SimbodySettings simbody_settings(const EngineOptions& options);

class SimbodyStepper {
 public:
  // `contacts`: the most of one step. Throws std::invalid_argument for its options, and what Simbody does.
  SimbodyStepper(const Scene& scene, std::size_t contacts);

  // Moves `state` on by dt; contacts() are then of the step. False where the state has diverged: it stays as it was.
  [[nodiscard]] bool step(RobotState& state, const JointCommand& command, const ExternalForces& pushes,
                          const MovingPartner& partner, NarrowPhase& narrow_phase);

  [[nodiscard]] const ContactSolver& contacts() const { return contacts_; }  // contact i is of point i
  [[nodiscard]] const ImplicitLaw& law() const { return law_; }
  [[nodiscard]] const Eigen::VectorXd& acceleration() const { return a_; }  // (6 + dof), mean over the step

 private:
  void apply(const ExternalForces& pushes);
  void solve(const RobotState& state, std::span<const ContactPoint> points);
  void add_stops(const RobotState& state);
  void advance(RobotState& state) const;

  std::shared_ptr<const RobotModel> robot_;
  double dt_;
  SimbodySettings settings_;
  ConstraintSoftness rigid_;
  SimbodyModel model_;
  ImplicitLaw law_;
  ContactSolver contacts_;
  Eigen::VectorXd no_force_, v_begin_, v_, a_;
};

}  // namespace duet
