#include "duet/controllers/stance.h"

#include "duet/controllers/vmc.h"
#include "tests/backends/g1_scene.h"
#include "tests/backends/small_robots.h"
#include "tests/support.h"

namespace duet {
namespace {

using test::thrown_message;

TEST(Stance, LegsOfTheG1AreItsFirstTwelveJoints) {
  const auto robot = test::g1();
  const Stance stance(*robot);
  ASSERT_EQ(stance.legs().size(), 2U);
  EXPECT_EQ(stance.legs()[0].joints, (std::vector<int>{0, 1, 2, 3, 4, 5}));
  EXPECT_EQ(stance.legs()[1].joints, (std::vector<int>{6, 7, 8, 9, 10, 11}));
  ASSERT_EQ(stance.upper().size(), 17U);
  EXPECT_EQ(stance.upper().front(), 12);
  EXPECT_EQ(stance.upper().back(), 28);
}

TEST(Stance, PointsAreOnTheGroundWhereTheRobotStandsAndMoveAsTheJacobianSays) {
  const auto robot = test::g1();
  const Stance stance(*robot);
  RobotState state = robot->standing_state();
  Kinematics kinematics(*robot);
  kinematics.update(state.X_WB, state.q);
  Eigen::Matrix3Xd points(3, stance.points()), moved(3, stance.points());
  stance.points_of(kinematics, points);
  EXPECT_LT(points.row(2).cwiseAbs().maxCoeff(), 2e-3);
  Eigen::MatrixXd J(3 * stance.points(), 6 + robot->dof());
  stance.jacobian_of(kinematics, points, J);
  const double h = 1e-7;
  state.q[3] += h;  // the left knee
  kinematics.update(state.X_WB, state.q);
  stance.points_of(kinematics, moved);
  const Eigen::VectorXd difference = Eigen::Map<const Eigen::VectorXd>((moved - points).eval().data(), J.rows()) / h;
  // The lowest point of a sphere does not turn with the link: the Jacobian's point differs by radius * angle.
  EXPECT_LT((difference - J.col(9)).cwiseAbs().maxCoeff(), 0.005 + 1e-6);
  EXPECT_GT(J.col(9).norm(), 0.1);
}

TEST(Stance, RobotsThatCannotStandAreRefused) {
  EXPECT_SENTENCE(thrown_message<std::invalid_argument>([] { make_vmc_controller(test::wheel()); }));
  EXPECT_SENTENCE(thrown_message<std::invalid_argument>([] { make_vmc_controller(test::sledge()); }));
}

}  // namespace
}  // namespace duet
