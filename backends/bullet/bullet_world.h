// One step of Bullet, as the backend and the bare loop make it: the torque law, Bullet's articulated-body algorithm,
// Bullet's sequential impulses, Bullet's integration.
#pragma once

#include <span>
#include <vector>

#include "duet/backends/bullet/articulation.h"
#include "duet/backends/engine_module.h"
#include "duet/backends/physics_backend.h"

namespace duet {

std::span<const EngineOption> bullet_options();

class BulletWorld {
 public:
  // `contacts`: the most that one step has. Options as bullet_options() has them, already checked.
  BulletWorld(const Scene& scene, std::size_t contacts);

  [[nodiscard]] Articulation& articulation() { return articulation_; }
  [[nodiscard]] const Articulation& articulation() const { return articulation_; }
  [[nodiscard]] const Kinematics& kinematics() const { return law_.kinematics(); }
  [[nodiscard]] const RowSolver& rows() const { return rows_; }

  // Law and poses of `state`, which is the articulation's. False where the state has diverged.
  [[nodiscard]] bool begin(const RobotState& state, const JointCommand& command);
  // From begin()'s state to the one after it, and the torques of the law. `pushes` may be null.
  void step(std::span<const ContactPoint> points, const ExternalForces* pushes, RobotState& state,
            Eigen::VectorXd& torques);

 private:
  void add_pushes(const ExternalForces& pushes);
  void solve(const Eigen::VectorXd& q);

  double dt_;
  std::shared_ptr<const RobotModel> robot_;
  Articulation articulation_;
  ImplicitLaw law_;
  RowSolver rows_;
  Eigen::VectorXd Q_, applied_, a_, before_, torques_;
};

}  // namespace duet
