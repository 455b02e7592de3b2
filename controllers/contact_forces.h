// Forces at the soles that come nearest to a wanted motion without pulling or slipping. Accelerated projected gradient
// with a fixed number of iterations: the time is known and the result depends on its input alone. No allocation.
#pragma once

#include <Eigen/Core>

namespace duet {

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
