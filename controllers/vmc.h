// A balance controller in the manner of virtual model control: it stands on both feet, keeps the centre of mass over
// them and tracks the reference's upper body. It does not step. It takes from the reference: joints that lead to no
// foot follow it; of the root it follows yaw and the place in the ground plane as far as the feet allow, at the
// standing height; the legs' angles follow from the feet and the pelvis and are not tracked. Source of the scheme:
// Pratt et al., "Virtual Model Control", IJRR 20 (2001); here the virtual forces become accelerations of a full inverse
// dynamics, and contact forces that cannot be had change the motion, not the feet.
#pragma once

#include <Eigen/Core>
#include <memory>

#include "duet/controllers/controller.h"

namespace duet {

// Gains of the wanted accelerations [1/s^2 and 1/s], and the weights of missing them.
struct VmcOptions {
  double com_stiffness = 43.0;
  double com_damping = 15.0;
  double height_stiffness = 60.0;
  double height_damping = 15.0;
  double tilt_stiffness = 80.0;
  double tilt_damping = 12.0;
  double com_weight = 1.0;
  double height_weight = 1.0;
  double tilt_weight = 0.1;
  double yaw_weight = 0.1;
  double pressure_gain = 0.7;        // of moving the centre of mass until the centre of pressure is central [1/s]
  double push_gain = 0.3;            // of the estimate of a push per tick, in [0, 1]; 0: pushes are not estimated
  double push_range = 40.0;          // largest push that is compensated [N]
  double leg_stiffness_share = 0.3;  // of the card's gains, around the predicted motion of the legs
  double leg_damping_share = 0.5;
  double friction = 0.5;  // that the planned forces rely on
};

// Throws std::invalid_argument for a robot without soles, with soles at the base itself or without a stance in its
// card.
std::unique_ptr<Controller> make_vmc_controller(std::shared_ptr<const RobotModel> robot);
std::unique_ptr<Controller> make_vmc_controller(std::shared_ptr<const RobotModel> robot, const VmcOptions& options);

// Forces at the soles that come nearest to a wanted motion without pulling or slipping. Accelerated projected gradient
// with a fixed number of iterations: the time is known and the result depends on its input alone. No allocation.

using Vector6d = Eigen::Matrix<double, 6, 1>;
using Matrix6d = Eigen::Matrix<double, 6, 6>;
using Matrix6Xd = Eigen::Matrix<double, 6, Eigen::Dynamic>;

// The nearest point (Euclidean) of the friction pyramid |f_x| <= mu f_z, |f_y| <= mu f_z.
Eigen::Vector3d project_on_pyramid(const Eigen::Vector3d& f, double mu);

class ContactForces {
 public:
  ContactForces(int points, double friction, double regularisation, int iterations);

  // Minimises |weights . (G f - b)|^2 + regularisation |f - f_rest|^2 over the pyramids, f = [f_1; f_2; ...] in W, and
  // starts from the last result. G is 6 x (3 points).
  const Eigen::VectorXd& solve(const Matrix6Xd& G, const Vector6d& b, const Vector6d& weights,
                               const Eigen::VectorXd& f_rest);
  void restart(const Eigen::VectorXd& f) { f_ = f; }

 private:
  double friction_;
  double regularisation_;
  int iterations_;
  Matrix6Xd A_;
  Eigen::VectorXd f_, previous_, y_;
};

}  // namespace duet
