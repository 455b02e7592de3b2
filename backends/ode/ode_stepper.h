// One step of the robot in ODE under the torque law. ODE has no armature and only explicit torques; so the step is
// foreseen on M + S with our own model (the law, the contacts, the stops), and ODE gets the joint torques with which it
// reaches the same acceleration. ODE then finds its own constraint and contact forces.
#pragma once

#include <Eigen/Core>
#include <span>
#include <vector>

#include "duet/backends/narrow_phase.h"
#include "duet/backends/ode/contact_forecast.h"
#include "duet/backends/ode/ode_world.h"
#include "duet/backends/physics_backend.h"

namespace duet {

class OdeStepper {
 public:
  // `contacts`: the most of one step. Throws std::invalid_argument (options) and std::runtime_error with ODE's message.
  OdeStepper(const Scene& scene, std::size_t contacts);

  [[nodiscard]] OdeWorld& world() { return world_; }
  [[nodiscard]] const OdeWorld& world() const { return world_; }

  // `state` to that after a step with these contacts. False: the state left the range of numbers or of sense.
  bool advance(const JointCommand& command, std::span<const ContactPoint> points, const ExternalForces* pushes,
               RobotState& state);
  [[nodiscard]] Eigen::Vector3d contact_force(std::size_t i) const { return world_.contact_force(i); }
  // The law's torques in the last step. [N m]
  void torques(Eigen::VectorXd& out) const { law_.torques(a_, out); }

 private:
  bool foresee(const RobotState& state, const JointCommand& command, std::span<const ContactPoint> points,
               const ExternalForces* pushes);
  void foresee_free();
  void foresee_contacts();
  void add_stops(const RobotState& state);
  void add_stop_torques();
  void add_pushes(const ExternalForces& pushes);
  void step(std::span<const ContactPoint> points, const ExternalForces* pushes, bool all_bounded);
  [[nodiscard]] OdeContact contact(const ContactPoint& point, std::size_t i, bool all_bounded);
  [[nodiscard]] bool all_stuck(std::span<const ContactPoint> points) const;

  std::shared_ptr<const RobotModel> robot_;
  double dt_;
  OdeOptions options_;
  ImplicitLaw law_;
  ContactForecast forecast_;
  OdeWorld world_;
  Eigen::VectorXd Q_, v_before_, v_, a_, tau_;
  Eigen::MatrixXd push_jacobian_;
  std::vector<char> stuck_;     // contacts of the last step that had no bound on friction
  std::vector<double> before_;  // the world before the step
};

}  // namespace duet
