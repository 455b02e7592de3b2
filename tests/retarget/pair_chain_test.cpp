#include "duet/retarget/pair_chain.h"

#include <gmock/gmock.h>

#include "duet/retarget/options.h"
#include "duet/robots/kinematics.h"
#include "tests/retarget/fixtures.h"
#include "tests/support.h"

namespace duet {
namespace {

using test::thrown_message;
using ::testing::ElementsAre;

std::string refusal(const RobotModel& robot, ContactKeypoints keypoints = ContactKeypoints::kNine) {
  return thrown_message<std::invalid_argument>([&] { make_chain(robot, keypoints); });
}

TEST(PairChain, PlacesPointsAsRobotKinematicsDoes) {
  std::mt19937 engine(3);
  std::uniform_real_distribution<double> uniform(-1.5, 1.5);
  for (const RobotModel& robot : {test::g1(), test::slanted_robot()}) {
    const PairChain chain = make_chain(robot, ContactKeypoints::kEleven);
    ASSERT_EQ(chain.keys(), 11);
    Kinematics kinematics(robot);
    for (int trial = 0; trial < 5; ++trial) {
      Eigen::VectorXd q(robot.dof());
      for (double& value : q) value = uniform(engine);
      const Pose X_WB{Eigen::Quaterniond(uniform(engine), 1.0, uniform(engine), uniform(engine)).normalized(),
                      Eigen::Vector3d(uniform(engine), uniform(engine), uniform(engine))};
      kinematics.update(X_WB, q);
      ChainPose pose;
      forward(chain, X_WB.R.toRotationMatrix(), X_WB.p, q, pose);
      for (int i = 0; i < kRetargetPairs; ++i) {
        const Eigen::Vector3d expected = kinematics.frame_position(robot.pairs[i].frame);
        EXPECT_LT((pose.points.col(chain.pair_points[i]) - expected).norm(), 1e-13) << robot.name << " pair " << i;
      }
      for (int k = 0; k < 9; ++k) {
        const Eigen::Vector3d expected = kinematics.frame_position(robot.keypoints[k].frame);
        EXPECT_LT((pose.points.col(chain.key_points[k]) - expected).norm(), 1e-13) << robot.name << " key " << k;
      }
    }
  }
}

TEST(PairChain, KeypointSetsAreThePrintedOnes) {
  const auto smpl = [](ContactKeypoints choice) { return make_chain(test::g1(), choice).key_smpl; };
  const std::vector<int> nine = {kHead,      kLeftShoulder, kRightShoulder, kLeftElbow, kRightElbow,
                                 kLeftWrist, kRightWrist,   kLeftHand,      kRightHand};
  EXPECT_EQ(smpl(ContactKeypoints::kNine), nine);
  EXPECT_EQ(smpl(ContactKeypoints::kSeven), std::vector<int>(nine.begin(), nine.begin() + 7));
  std::vector<int> eleven = nine;
  eleven.insert(eleven.end(), {kLeftHip, kRightHip});
  EXPECT_EQ(smpl(ContactKeypoints::kEleven), eleven);
}

TEST(PairChain, RefusesRobotsWithoutPairsOrKeypoints) {
  RobotModel robot = test::g1();
  robot.pairs.pop_back();
  EXPECT_SENTENCE(refusal(robot));
  robot.pairs.clear();
  EXPECT_SENTENCE(refusal(robot));

  robot = test::g1();
  std::swap(robot.pairs[0], robot.pairs[1]);
  EXPECT_SENTENCE(refusal(robot));

  robot = test::g1();
  robot.pairs[3].frame = 9999;
  EXPECT_SENTENCE(refusal(robot));

  robot = test::g1();
  robot.pairs[4].smpl = robot.pairs[3].smpl;
  EXPECT_SENTENCE(refusal(robot));

  robot = test::g1();
  robot.keypoints.clear();
  EXPECT_SENTENCE(refusal(robot));

  robot = test::g1();
  robot.keypoints[2].smpl = -1;
  EXPECT_SENTENCE(refusal(robot));

  robot = test::g1();
  robot.joints.pop_back();
  EXPECT_SENTENCE(refusal(robot));

  robot = test::g1();
  robot.links[2].parent = 5;
  EXPECT_SENTENCE(refusal(robot));

  robot = test::g1();
  std::swap(robot.joints[4].lower, robot.joints[4].upper);
  EXPECT_SENTENCE(refusal(robot));
}

std::string refusal(const std::string& text) {
  return thrown_message<std::invalid_argument>([&] { static_cast<void>(parse_contact_keypoints(text)); });
}

TEST(ContactKeypoints, TextGoesThereAndBack) {
  const std::string text = "left_hand:2,right_hand@right_wrist_yaw_link:0.5:3,head,left_wrist:1:0";
  const std::vector<ContactKeypoint> keypoints = parse_contact_keypoints(text);
  ASSERT_EQ(keypoints.size(), 4U);
  EXPECT_EQ(keypoints[0], (ContactKeypoint{.smpl = kLeftHand, .weight = 2.0}));
  EXPECT_EQ(keypoints[1],
            (ContactKeypoint{.smpl = kRightHand, .frame = "right_wrist_yaw_link", .weight = 0.5, .object = 3.0}));
  EXPECT_EQ(keypoints[2], (ContactKeypoint{.smpl = kHead}));
  EXPECT_EQ(format_contact_keypoints(keypoints), text);
  EXPECT_TRUE(parse_contact_keypoints("").empty());
}

TEST(ContactKeypoints, FaultsSayWhatWasExpected) {
  EXPECT_SENTENCE(refusal("left_hnd"));
  EXPECT_SENTENCE(refusal("head,head:2"));
  for (const char* bad : {"head:", "head:-1", "head:nan", "head:inf", "head:1x", "head:1:-0.1"})
    EXPECT_SENTENCE(refusal(bad));
  for (const char* bad : {"head:1:1:1", "head@", "head@a@b"}) EXPECT_SENTENCE(refusal(bad));
  EXPECT_EQ(refusal("head:0"), "(nothing was thrown)");
}

TEST(ContactKeypoints, AnObjectIsSeenByHandsElseByWristsUnlessTold) {
  EXPECT_THAT(object_weights(parse_contact_keypoints("head,left_wrist,left_hand,right_hand")), ElementsAre(0, 0, 1, 1));
  EXPECT_THAT(object_weights(parse_contact_keypoints("head,left_wrist,right_wrist")), ElementsAre(0, 1, 1));
  EXPECT_THAT(object_weights(parse_contact_keypoints("head:1:4,left_hand:1:0,right_hand")), ElementsAre(4, 0, 1));
}

TEST(ContactKeypoints, FramesAreTheCardsOrTheNamedOnes) {
  const RobotModel& robot = test::g1();
  const PairChain nine = make_chain(robot, ContactKeypoints::kNine);
  const PairChain listed =
      make_chain(robot, ContactKeypoints::kNine,
                 parse_contact_keypoints("head,left_shoulder,right_shoulder,left_elbow,right_elbow,"
                                         "left_wrist,right_wrist,left_hand,right_hand"));
  for (std::size_t i = 0; i < nine.key_smpl.size(); ++i) {
    const auto at = std::find(listed.key_smpl.begin(), listed.key_smpl.end(), nine.key_smpl[i]);
    ASSERT_NE(at, listed.key_smpl.end());
    EXPECT_EQ(listed.key_points[at - listed.key_smpl.begin()], nine.key_points[i]);
  }
  EXPECT_FALSE(nine.weighted());
  EXPECT_FALSE(listed.weighted());
  EXPECT_EQ(std::count(nine.key_object.begin(), nine.key_object.end(), 1.0), 2);
  EXPECT_TRUE(make_chain(robot, ContactKeypoints::kNine, parse_contact_keypoints("head:0.5")).weighted());
  const std::string frame = robot.frames[robot.pairs.front().frame].name;
  EXPECT_EQ(robot_frames(robot, parse_contact_keypoints("head@" + frame)), std::vector{robot.pairs.front().frame});
  EXPECT_SENTENCE(thrown_message<std::invalid_argument>(
      [&] { static_cast<void>(robot_frames(robot, parse_contact_keypoints("head@nothing"))); }));
  EXPECT_SENTENCE(thrown_message<std::invalid_argument>(
      [&] { static_cast<void>(robot_frames(robot, parse_contact_keypoints("spine2"))); }));
}

}  // namespace
}  // namespace duet
