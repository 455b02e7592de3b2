// The robot as a btMultiBody. Bullet's frame of a link lies at its centre of mass along its principal axes; joints keep
// the card's order. Bullet's generalised velocity is [w (W), velocity of the base's centre of mass (W), qd].
#pragma once

#include <BulletDynamics/Featherstone/btMultiBody.h>

#include <Eigen/Geometry>
#include <memory>
#include <span>
#include <vector>

#include "duet/backends/scene.h"
#include "duet/core/robot_state.h"

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

}  // namespace duet
