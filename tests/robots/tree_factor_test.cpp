// The factor of a humanoid's mass matrix against a dense one.
#include <gtest/gtest.h>

#include <Eigen/Cholesky>

#include "duet/robots/dynamics.h"

namespace duet {
namespace {

struct Humanoid {
  RobotModel robot = load_robot(default_card_path());
  int n = 6 + robot.dof();
  Eigen::VectorXd inertia = Eigen::VectorXd::LinSpaced(robot.dof(), 0.01, 0.3);
  Eigen::MatrixXd mass = Eigen::MatrixXd::Zero(n, n);
  TreeFactor factor{robot};
  Humanoid() {
    Dynamics dynamics(robot);
    dynamics.update(robot.standing_state());
    mass = dynamics.mass();
    EXPECT_TRUE(factor.compute(mass, inertia));
  }
  [[nodiscard]] Eigen::MatrixXd dense_solution(const Eigen::MatrixXd& right) const {
    Eigen::MatrixXd H = mass;
    H.diagonal().tail(robot.dof()) += inertia;
    return H.llt().solve(right);
  }
};

constexpr double kRounding = 1e-9;  // of responses of about 1, condition 1e4

TEST(TreeFactor, SolvesAsADenseFactorDoes) {
  const Humanoid humanoid;
  const Eigen::MatrixXd identity = Eigen::MatrixXd::Identity(humanoid.n, humanoid.n);
  const Eigen::MatrixXd expected = humanoid.dense_solution(identity);
  for (int i = 0; i < humanoid.n; ++i) {
    Eigen::VectorXd column = identity.col(i);
    humanoid.factor.solve(column);
    EXPECT_LT((column - expected.col(i)).cwiseAbs().maxCoeff(), kRounding * expected.cwiseAbs().maxCoeff());
  }
}

TEST(TreeFactor, SolvesThreeColumnsWithFewEntriesAsDenseOnes) {
  const Humanoid humanoid;
  std::vector<int> rows;
  TreeFactor::Triple columns = TreeFactor::Triple::Zero(humanoid.n, 3);
  const int link = humanoid.robot.shapes[humanoid.robot.feet[0]].link;
  for (int k = link; k > 0; k = humanoid.robot.links[k].parent) rows.push_back(5 + k);
  for (int k = 5; k >= 0; --k) rows.push_back(k);
  for (const int row : rows) columns.row(row) << 1.0 + row, -0.5 * row, 2.0;
  const Eigen::MatrixXd expected = humanoid.dense_solution(columns);
  humanoid.factor.solve(rows, columns);
  EXPECT_LT((columns - expected).cwiseAbs().maxCoeff(), kRounding * expected.cwiseAbs().maxCoeff());
}

TEST(TreeFactor, RefusesWhatIsNotPositiveDefinite) {
  Humanoid humanoid;
  humanoid.mass(7, 7) = -1.0;
  EXPECT_FALSE(humanoid.factor.compute(humanoid.mass, humanoid.inertia));
}

}  // namespace
}  // namespace duet
