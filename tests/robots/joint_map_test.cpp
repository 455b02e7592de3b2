#include <gtest/gtest.h>

#include <algorithm>

#include "duet/robots/roles.h"
#include "tests/robots/fixtures.h"

namespace duet {
namespace {

Eigen::VectorXd counting(int n) { return Eigen::VectorXd::LinSpaced(n, 1.0, n); }

TEST(JointMap, EveryJointGoesWhereItsNameStandsTheFirstAndTheLastToo) {
  const RobotModel& robot = test::g1();
  std::vector<std::string> backwards = robot.joint_names();
  std::reverse(backwards.begin(), backwards.end());
  const JointMap map(backwards, robot);
  const Eigen::VectorXd values = counting(robot.dof());
  EXPECT_EQ(map.positions(values), Eigen::VectorXd(values.reverse()));
  EXPECT_EQ(map.rates(values), Eigen::VectorXd(values.reverse()));
  EXPECT_EQ(JointMap(robot.joint_names(), robot).positions(values), values);
}

TEST(JointMap, AJointThatIsMissingStaysAtNeutralAndAtRest) {
  const RobotModel& robot = test::g1();
  for (const int missing : {0, 7, robot.dof() - 1}) {
    std::vector<std::string> from = robot.joint_names();
    from.erase(from.begin() + missing);
    const JointMap map(from, robot);
    const Eigen::VectorXd values = counting(robot.dof() - 1);
    const Eigen::VectorXd q = map.positions(values), v = map.rates(values);
    for (int j = 0; j < robot.dof(); ++j) {
      EXPECT_EQ(q[j], j == missing ? robot.neutral[j] : values[j - (j > missing ? 1 : 0)]) << missing << " " << j;
      EXPECT_EQ(v[j], j == missing ? 0.0 : values[j - (j > missing ? 1 : 0)]) << missing << " " << j;
    }
  }
}

TEST(JointMap, AMotionOfTheSameJointsInAnotherOrderIsTheSameMotion) {
  const RobotModel& robot = test::g1();
  RobotMotion motion{50.0, robot.joint_names(), std::vector<Pose>(3), Eigen::MatrixXd(robot.dof(), 3)};
  for (int t = 0; t < 3; ++t) motion.q.col(t) = (t + 1) * counting(robot.dof());
  RobotMotion turned = motion;
  std::reverse(turned.joint_names.begin(), turned.joint_names.end());
  turned.q = motion.q.colwise().reverse();
  const RobotMotion back = on_body(turned, robot);
  EXPECT_EQ(back.joint_names, motion.joint_names);
  EXPECT_EQ(back.q, motion.q);
  EXPECT_EQ(on_body(motion, robot).q, motion.q);
}

TEST(JointMap, RobotsWithoutAJointInCommonAreRefused) {
  EXPECT_SENTENCE(test::thrown_message<std::invalid_argument>([] {
    JointMap({"Waist", "Left_Hip_Pitch"}, test::g1());
  }));
  EXPECT_NO_THROW(JointMap({}, test::g1()));
}

}  // namespace
}  // namespace duet
