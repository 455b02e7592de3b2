#include "duet/retarget/pair_chain.h"

#include "duet/robots/kinematics.h"
#include "tests/retarget/fixtures.h"
#include "tests/support.h"

namespace duet {
namespace {

using test::thrown_message;

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

}  // namespace
}  // namespace duet
