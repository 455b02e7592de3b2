#include "duet/robots/roles.h"

#include <gtest/gtest.h>

#include <algorithm>

#include "duet/robots/card.h"
#include "tests/robots/fixtures.h"

namespace duet {
namespace {

using test::g1;
using test::kSmallCard;
using test::load_small;
using ::testing::ElementsAre;

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

TEST(PhasePrimitives, TheWayToTheActIsStraightAndEven) {
  RobotMotion motion;
  motion.rate_hz = 50.0;
  const Pose start{.R = yaw_rotation(0.2), .p = {1.0, -1.0, 0.7}}, goal{.R = yaw_rotation(0.8), .p = {3.0, 1.0, 0.8}};
  motion.root.assign(30, goal);
  walk_straight(motion, {.act_begin = 20, .act_end = 25}, start);
  for (int t = 0; t <= 20; ++t) {
    const Pose expected = interpolate(start, goal, t / 20.0);
    EXPECT_LT((motion.root[t].p - expected.p).norm(), 1e-12) << t;
    EXPECT_LT(motion.root[t].R.angularDistance(expected.R), 1e-7) << t;
  }
  EXPECT_EQ(motion.root[29].p, goal.p);
}

std::string error_with(const std::string& keys) { return test::load_error(kSmallCard + keys, test::kSmallUrdf); }

TEST(CardRoles, OfTheG1AreItsParts) {
  const RobotRoles& roles = g1().roles;
  EXPECT_THAT(roles.legs[0], ElementsAre(0, 1, 2, 3, 4, 5));
  EXPECT_THAT(roles.legs[1], ElementsAre(6, 7, 8, 9, 10, 11));
  EXPECT_THAT(roles.waist, ElementsAre(12, 13, 14));
  EXPECT_THAT(roles.arms[0], ElementsAre(15, 16, 17, 18, 19, 20, 21));
  EXPECT_THAT(roles.wrists, ElementsAre(19, 20, 21, 26, 27, 28));
  EXPECT_EQ(roles.compound.size(), 7u);
  EXPECT_EQ(roles.bodies.size(), 22u);
  EXPECT_EQ(g1().frames[roles.push_frame].name, "torso_link");
  EXPECT_EQ(g1().frames[roles.imu_frame].name, "pelvis");
  EXPECT_EQ(g1().fall.height, 0.45);
  EXPECT_EQ(g1().fall.cos_tilt, 0.7);
  EXPECT_EQ(g1().stance_size().half_width, 0.1185);
  EXPECT_EQ(g1().stance_size().shift, Eigen::Vector2d(0.02, 0.03));
  EXPECT_EQ(g1().bounds_of_root().lowest, 0.62);
  EXPECT_EQ(g1().bounds_of_root().highest, 0.77);
  EXPECT_EQ(roles.pose_ranges.at(23), (std::pair{-1.1, 0.0}));
}

TEST(CardRoles, ASilentCardHasNone) {
  const RobotModel small = load_small();
  EXPECT_TRUE(small.roles.legs[0].empty());
  EXPECT_THAT(small.roles.counterpart, ElementsAre(0, 1));
  EXPECT_THAT(small.roles.bodies, ElementsAre(0, 1, 2));
  EXPECT_EQ(small.roles.push_frame, 0);
  EXPECT_DOUBLE_EQ(small.fall.height, 0.57 * small.standing_height);
  EXPECT_EQ(small.pose("wave"), nullptr);
  EXPECT_SENTENCE(test::thrown_message<std::invalid_argument>([&] { static_cast<void>(small.stance_size()); }));
  EXPECT_SENTENCE(test::thrown_message<std::invalid_argument>([&] { static_cast<void>(small.bounds_of_root()); }));
}

TEST(CardRoles, APoseIsTheNeutralOneButForItsAngles) {
  const RobotModel small = load_small(kSmallCard + "poses: {wave: {elbow: 1.5}}\n");
  ASSERT_NE(small.pose("wave"), nullptr);
  EXPECT_EQ(*small.pose("wave"), Eigen::Vector2d(0.5, 1.5));
}

TEST(CardRoles, ALockedJointIsLeftOut) {
  const std::string card = test::replaced(kSmallCard, "  - {name: elbow, armature: 0.02, kp: 10, kd: 0.5}\n", "") +
                           "locked: [{name: elbow, position: 0}]\nwaist: [shoulder, elbow]\n"
                           "pose_ranges: {elbow: [-1, 1], shoulder: [0, 1]}\n";
  const RobotModel small = load_small(card);
  EXPECT_THAT(small.roles.waist, ElementsAre(0));
  EXPECT_EQ(small.roles.pose_ranges.size(), 1u);
}

TEST(CardRoles, NamesThatAreNoneAreRefusedWithTheirLine) {
  for (const char* text :
       {"waist: [shouldr]\n", "push_link: bric\n", "bodies: [base, none]\n", "poses: {wave: {elbo: 1}}\n"})
    EXPECT_SENTENCE(error_with(text));
}

TEST(CardRoles, SidesThatDoNotMirrorAreRefused) {
  for (const char* text : {"legs: {left: [shoulder], right: []}\n", "legs: {left: [shoulder], right: [elbow]}\n",
                           "arms: {left: [elbow], right: [elbow]}\n", "arms: {left: [elbow]}\n"})
    EXPECT_SENTENCE(error_with(text));
}

TEST(CardRoles, NumbersOutOfRangeAreRefused) {
  for (const char* text :
       {"fall: {height: 0, cos_tilt: 0.7}\n", "pose_ranges: {shoulder: [1, 0]}\n", "pose_ranges: {shoulder: [0, 9]}\n",
        "pose_ranges: {shoulder: 1}\n", "pose_ranges: {shoulder: [a, 1]}\n", "poses: {wave: {shoulder: -7}}\n",
        "poses: {wave: {shoulder: up}}\n", "poses: {wave: [1]}\n", "poses: {wave: {shoulder: 1, shoulder: 1}}\n",
        "waist: shoulder\n"})
    EXPECT_SENTENCE(error_with(text));
  std::string many = "compound: [";
  for (int i = 0; i < 65; ++i) many += "[elbow], ";
  EXPECT_SENTENCE(error_with(many + "]\n"));
}

TEST(Roles, TheG1MirrorsAtItsPlane) {
  for (int j = 0; j < g1().dof(); ++j) {
    const std::string& name = g1().joints[j].name;
    const std::string side = name.starts_with("left_")    ? "right_" + name.substr(5)
                             : name.starts_with("right_") ? "left_" + name.substr(6)
                                                          : name;
    EXPECT_EQ(g1().joints[g1().roles.counterpart[j]].name, side);
    const bool pitches = name.find("pitch") != std::string::npos || name.find("knee") != std::string::npos ||
                         name.find("elbow") != std::string::npos;
    EXPECT_EQ(mirror_sign(g1(), j), pitches ? 1.0 : -1.0) << name;
  }
}

TEST(Roles, TheWaistsTiltIsAllButItsYaw) {
  EXPECT_THAT(tilting_waist(g1()), ElementsAre(13, 14));
  EXPECT_THAT(leg_joints(g1()), ElementsAre(0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11));
  EXPECT_TRUE(is_roll(g1(), 5));
  EXPECT_FALSE(is_roll(g1(), 4));
}

TEST(Roles, TheG1sBaseIsItsPelvis) {
  EXPECT_TRUE(base_is_pelvis(g1()));
  const Pose X = pelvis_in_base(g1(), g1().neutral);
  EXPECT_EQ(X.p, Eigen::Vector3d::Zero());
  EXPECT_EQ(X.R.angularDistance(Eigen::Quaterniond::Identity()), 0.0);
}

}  // namespace
}  // namespace duet
