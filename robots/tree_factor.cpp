#include "duet/robots/tree_factor.h"

#include <cmath>

namespace duet {

TreeFactor::TreeFactor(const RobotModel& model) {
  const int n = 6 + model.dof();
  parent_.resize(n);
  ancestors_.resize(n);
  for (int i = 0; i < n; ++i) {
    parent_[i] = i - 1;
    if (i >= 6) {
      const int link = model.links[i - 5].parent;
      parent_[i] = link > 0 ? 5 + link : 5;
    }
    for (int k = parent_[i]; k >= 0; k = parent_[k]) ancestors_[i].push_back(k);
  }
  L_ = Eigen::MatrixXd::Zero(n, n);
  inverse_ = Eigen::VectorXd::Zero(n);
}

bool TreeFactor::compute(const Eigen::MatrixXd& mass, const Eigen::VectorXd& joint_inertia) {
  const int n = static_cast<int>(parent_.size());
  L_.triangularView<Eigen::Lower>() = mass;
  L_.diagonal().tail(n - 6) += joint_inertia;
  for (int k = n - 1; k >= 0; --k) {
    if (!(L_(k, k) > 0.0)) return false;
    const double diagonal = std::sqrt(L_(k, k)), inverse = 1.0 / diagonal;
    L_(k, k) = diagonal;
    inverse_[k] = inverse;
    const std::vector<int>& above = ancestors_[k];
    for (const int i : above) L_(k, i) *= inverse;
    for (std::size_t a = 0; a < above.size(); ++a) {
      const int i = above[a];
      const double factor = L_(k, i);
      for (std::size_t b = a; b < above.size(); ++b) L_(i, above[b]) -= factor * L_(k, above[b]);
    }
  }
  return true;
}

void TreeFactor::solve(Eigen::VectorXd& x) const {
  const int n = static_cast<int>(parent_.size());
  for (int i = n - 1; i >= 0; --i) {
    x[i] *= inverse_[i];
    for (const int j : ancestors_[i]) x[j] -= L_(i, j) * x[i];
  }
  for (int i = 0; i < n; ++i) {
    double value = x[i];
    for (const int j : ancestors_[i]) value -= L_(i, j) * x[j];
    x[i] = value * inverse_[i];
  }
}

void TreeFactor::half_solve(std::span<const int> rows, Triple& x) const {
  for (const int i : rows) {
    const Eigen::RowVector3d scaled = inverse_[i] * x.row(i);
    x.row(i) = scaled;
    for (const int j : ancestors_[i]) x.row(j) -= L_(i, j) * scaled;
  }
}

void TreeFactor::solve(std::span<const int> rows, Triple& x) const {
  half_solve(rows, x);
  for (int i = 0; i < static_cast<int>(parent_.size()); ++i) {
    Eigen::RowVector3d value = x.row(i);
    for (const int j : ancestors_[i]) value -= L_(i, j) * x.row(j);
    x.row(i) = inverse_[i] * value;
  }
}

}  // namespace duet
