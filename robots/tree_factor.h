// Factor of a symmetric positive definite matrix with the sparsity of a kinematic tree, H = L^T L: no fill-in, so a
// humanoid's costs about a third of a dense one. Source: Featherstone, Rigid Body Dynamics Algorithms, section 6.5. No
// allocation after construction.
#pragma once

#include <Eigen/Core>
#include <span>
#include <vector>

#include "duet/robots/robot_model.h"

namespace duet {

class TreeFactor {
 public:
  using Triple = Eigen::Matrix<double, Eigen::Dynamic, 3, Eigen::RowMajor>;

  // Prepares a factor over the generalised velocity of robots/kinematics.h: 6 + dof rows.
  explicit TreeFactor(const RobotModel& model);

  // Factors mass + diag(0, joint_inertia). False where it is not positive definite.
  bool compute(const Eigen::MatrixXd& mass, const Eigen::VectorXd& joint_inertia);
  // x <- H^-1 x
  void solve(Eigen::VectorXd& x) const;
  // The same for three columns that are zero outside `rows`, which fall and hold the ancestors of all they hold.
  void solve(std::span<const int> rows, Triple& x) const;
  // x <- L^-T x: the products of two such columns are those of the columns with H^-1 between them.
  void half_solve(std::span<const int> rows, Triple& x) const;

 private:
  std::vector<int> parent_;                  // of each row: the next row that its joint's motion reaches; -1: none
  std::vector<std::vector<int>> ancestors_;  // of each row, nearest first
  Eigen::MatrixXd L_;                        // lower triangle, where the tree has entries
  Eigen::VectorXd inverse_;                  // of its diagonal
};

}  // namespace duet
