#include "duet/controllers/contact_forces.h"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>

namespace duet {

// With z fixed, x and y are clamped to mu z; the derivative along z then vanishes at one of three values, according to
// how many of the two are clamped.
Eigen::Vector3d project_on_pyramid(const Eigen::Vector3d& f, double mu) {
  const double larger = std::max(std::abs(f.x()), std::abs(f.y()));
  const double smaller = std::min(std::abs(f.x()), std::abs(f.y()));
  double z = f.z();
  if (larger > mu * z) z = (f.z() + mu * larger) / (1.0 + mu * mu);
  if (smaller > mu * z) z = (f.z() + mu * (larger + smaller)) / (1.0 + 2.0 * mu * mu);
  z = std::max(z, 0.0);
  return {std::clamp(f.x(), -mu * z, mu * z), std::clamp(f.y(), -mu * z, mu * z), z};
}

ContactForces::ContactForces(int points, double friction, double regularisation, int iterations)
    : friction_(friction),
      regularisation_(regularisation),
      iterations_(iterations),
      A_(6, 3 * points),
      f_(Eigen::VectorXd::Zero(3 * points)),
      previous_(f_),
      y_(f_) {}

const Eigen::VectorXd& ContactForces::solve(const Matrix6Xd& G, const Vector6d& b, const Vector6d& weights,
                                            const Eigen::VectorXd& f_rest) {
  A_.noalias() = weights.asDiagonal() * G;
  const Vector6d target = weights.cwiseProduct(b);
  const Matrix6d gram = A_ * A_.transpose();  // its largest eigenvalue is that of the Hessian without regularisation
  const Eigen::SelfAdjointEigenSolver<Matrix6d> spectrum(gram, Eigen::EigenvaluesOnly);
  const double step = 1.0 / (spectrum.eigenvalues()[5] + regularisation_);
  y_ = f_;
  double momentum = 1.0;
  for (int iteration = 0; iteration < iterations_; ++iteration) {
    previous_ = f_;
    const Vector6d residual = A_ * y_ - target;
    f_.noalias() = y_ - step * regularisation_ * (y_ - f_rest);
    f_.noalias() -= step * (A_.transpose() * residual);
    for (Eigen::Index i = 0; i < f_.size(); i += 3) f_.segment<3>(i) = project_on_pyramid(f_.segment<3>(i), friction_);
    const double next = 0.5 * (1.0 + std::sqrt(1.0 + 4.0 * momentum * momentum));
    y_ = f_ + (momentum - 1.0) / next * (f_ - previous_);
    momentum = next;
  }
  return f_;
}

}  // namespace duet
