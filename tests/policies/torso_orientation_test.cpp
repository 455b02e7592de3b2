#include "duet/policies/phase_adaptation.h"
#include "tests/policies/fixtures.h"
#include "tests/support.h"

namespace duet {
namespace {

using test::g1;

constexpr double kSolved = 1e-7;  // angularDistance near 0 is sqrt(epsilon)

Eigen::VectorXd random_angles(Random& random, double share) {
  const RobotModel& robot = *g1();
  Eigen::VectorXd q(robot.dof());
  for (int j = 0; j < robot.dof(); ++j) {
    const RobotJoint& joint = robot.joints[static_cast<std::size_t>(j)];
    q[j] = 0.5 * (joint.lower + joint.upper) + 0.5 * share * (joint.upper - joint.lower) * random.uniform(-1.0, 1.0);
  }
  return q;
}

int joint(const char* name) { return g1()->joint_index(name); }

TEST(TorsoOrientation, IsTheProductOfTheWaistsHinges) {
  const TorsoOrientation torso(*g1());
  Eigen::VectorXd q = g1()->neutral;
  q[joint("waist_yaw_joint")] = 0.7;
  q[joint("waist_roll_joint")] = -0.3;
  q[joint("waist_pitch_joint")] = 0.4;
  const Eigen::Quaterniond expected = Eigen::AngleAxisd(0.7, Eigen::Vector3d::UnitZ()) *
                                      Eigen::AngleAxisd(-0.3, Eigen::Vector3d::UnitX()) *
                                      Eigen::AngleAxisd(0.4, Eigen::Vector3d::UnitY());
  EXPECT_NEAR(torso.at(q).angularDistance(expected), 0.0, kSolved);
}

TEST(TorsoOrientation, FindsEveryOrientationInsideTheLimitsFromWithinARightAngle) {
  const TorsoOrientation torso(*g1());
  Random random(1, 1);
  int solved = 0;
  for (int i = 0; i < 1000; ++i) {
    Eigen::VectorXd q = random_angles(random, 0.95), q_goal = random_angles(random, 0.95);
    // Further round, the short way to the goal may lead through the part of the circle that the yaw cannot reach.
    for (Eigen::VectorXd* angles : {&q, &q_goal}) (*angles)[joint("waist_yaw_joint")] *= 0.5;
    const Eigen::Quaterniond goal = torso.at(q_goal);
    if (torso.at(q).angularDistance(goal) > 0.5 * std::numbers::pi) continue;
    torso.solve(goal, q);
    EXPECT_NEAR(torso.at(q).angularDistance(goal), 0.0, kSolved) << i;
    ++solved;
  }
  EXPECT_GT(solved, 300);
}

TEST(TorsoOrientation, MovesNothingButTheWaistAndKeepsItsLimits) {
  const TorsoOrientation torso(*g1());
  Random random(2, 1);
  const Eigen::VectorXd lower = g1()->lower(), upper = g1()->upper();
  for (int i = 0; i < 200; ++i) {
    const Eigen::VectorXd before = random_angles(random, 0.9);
    Eigen::VectorXd q = before;
    torso.solve(test::random_upright(random, 1.4), q);
    for (int j = 0; j < g1()->dof(); ++j) {
      const std::string& name = g1()->joints[static_cast<std::size_t>(j)].name;
      if (name.starts_with("waist"))
        EXPECT_TRUE(lower[j] <= q[j] && q[j] <= upper[j]) << name;
      else
        EXPECT_EQ(q[j], before[j]) << name;
    }
  }
}

TEST(TorsoOrientation, ComesAsNearAsTheLimitsAllow) {
  const TorsoOrientation torso(*g1());
  Eigen::VectorXd q = g1()->neutral;
  torso.solve(Eigen::Quaterniond(Eigen::AngleAxisd(1.0, Eigen::Vector3d::UnitY())), q);
  EXPECT_NEAR(q[joint("waist_pitch_joint")], g1()->joints[joint("waist_pitch_joint")].upper, 1e-12);
  EXPECT_NEAR(q[joint("waist_roll_joint")], 0.0, 1e-9);
  EXPECT_NEAR(q[joint("waist_yaw_joint")], 0.0, 1e-9);

  // No angle of the waist nearby is better, whichever goal is out of reach.
  Random random(3, 1);
  for (int i = 0; i < 50; ++i) {
    const Eigen::Quaterniond goal = test::random_upright(random, 1.2);
    torso.solve(goal, q = g1()->neutral);
    const double best = torso.at(q).angularDistance(goal);
    for (int k = 0; k < 20; ++k) {
      Eigen::VectorXd other = q;
      for (const char* name : {"waist_yaw_joint", "waist_roll_joint", "waist_pitch_joint"}) {
        const RobotJoint& limits = g1()->joints[static_cast<std::size_t>(joint(name))];
        other[joint(name)] = std::clamp(q[joint(name)] + random.uniform(-0.05, 0.05), limits.lower, limits.upper);
      }
      EXPECT_GE(torso.at(other).angularDistance(goal), best - 1e-6);
    }
  }
}

TEST(TorsoOrientation, OfARobotWithoutAWaistIsTheBase) {
  RobotModel robot = *g1();
  robot.roles.waist.clear();
  const TorsoOrientation torso(robot);
  Eigen::VectorXd q = Eigen::VectorXd::Constant(29, 0.2);
  EXPECT_EQ(torso.at(q).w(), 1.0);
  torso.solve(yaw_rotation(0.5), q);
  EXPECT_EQ(q, Eigen::VectorXd::Constant(29, 0.2));
}

// The waist of the T1 is below its trunk, which is the base: it turns the pelvis the other way.
TEST(TorsoOrientation, OfAWaistBelowTheBaseIsThatOfTheBaseInThePelvis) {
  const RobotModel& robot = *test::t1();
  const TorsoOrientation torso(robot);
  const int waist = robot.joint_index("Waist");
  Eigen::VectorXd q = robot.neutral;
  for (const double angle : {-1.2, -1e-9, 0.0, 0.4, 1.5}) {
    q[waist] = angle;
    EXPECT_NEAR(torso.at(q).angularDistance(pelvis_in_base(robot, q).R.conjugate()), 0.0, kSolved);
  }
}

TEST(TorsoOrientation, AWaistBelowTheBaseIsTurnedUnderIt) {
  const RobotModel& robot = *test::t1();
  const TorsoOrientation torso(robot);
  Eigen::VectorXd q = robot.neutral;
  torso.solve(yaw_rotation(0.6), q);
  EXPECT_NEAR(q[robot.joint_index("Waist")], -0.6, 1e-9);
  torso.solve(yaw_rotation(0.6) * Eigen::AngleAxisd(0.3, Eigen::Vector3d::UnitY()), q);  // which it cannot tilt
  EXPECT_NEAR(torso.at(q).angularDistance(yaw_rotation(0.6)), 0.0, 1e-6);
  Eigen::VectorXd rest = q - robot.neutral;
  rest[robot.joint_index("Waist")] = 0.0;
  EXPECT_EQ(rest.norm(), 0.0);
}

}  // namespace
}  // namespace duet
