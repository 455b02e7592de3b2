#include <gtest/gtest.h>

#include <cmath>

#include "duet/core/recording.h"
#include "duet/metrics/locomotion.h"
#include "duet/metrics/retargeting.h"
#include "duet/motion/interaction_clip.h"
#include "duet/robots/kinematics.h"
#include "tests/support.h"

namespace duet {
namespace {

const RobotModel& g1() {
  static const RobotModel model = load_robot(default_card_path());
  return model;
}

// Two people who stand still 2 m apart, and the robot standing in the place of one.
PairedMotion standing(int frames) {
  PairedMotion motion;
  HumanMotion person;
  person.joints = PointTracks(frames, kSmplJoints);
  for (int t = 0; t < frames; ++t) {
    for (int j = 0; j < kSmplJoints; ++j) {
      const bool left = kSmplMirror[j] > j, middle = kSmplMirror[j] == j;
      person.joints.at(t, j) = Eigen::Vector3d(0.01 * j, middle ? 0.0 : left ? 0.1 : -0.1, 0.05 * j + 0.1);
    }
    for (const int foot : {kLeftAnkle, kRightAnkle, kLeftToe, kRightToe}) person.joints.at(t, foot).z() = 0.08;
  }
  motion.source_reactor = person;
  for (int t = 0; t < frames; ++t) person.joints.frame(t).row(0).array() += 2.0;
  motion.source_partner = motion.partner = person;
  const RobotState state = g1().standing_state();
  motion.robot.rate_hz = 50.0;
  motion.robot.joint_names = g1().joint_names();
  motion.robot.q = g1().neutral.replicate(1, frames);
  motion.robot.root.assign(frames, state.X_WB);
  return motion;
}

TEST(GroundingMetrics, ARobotThatStandsIsAtZero) {
  const auto figures = grounding_metrics(standing(30), g1());
  EXPECT_NEAR(figures.at("sole_height"), 0.0, 2e-3);
  EXPECT_NEAR(figures.at("foot_skate"), 0.0, 1e-12);
  EXPECT_EQ(figures.at("penetration_max"), 0.0);
  EXPECT_EQ(figures.at("bone_change_max"), 0.0);
  EXPECT_EQ(figures.at("joint_speed_max"), 0.0);
  EXPECT_EQ(figures.at("limit_violations"), 0.0);
  EXPECT_EQ(figures.at("speed_violations"), 0.0);
  EXPECT_NEAR(figures.at("root_roll_max"), 0.0, 1e-12);
}

TEST(GroundingMetrics, EachFaultIsSeen) {
  PairedMotion motion = standing(30);
  for (int t = 0; t < 30; ++t) {
    motion.robot.root[t].p += Eigen::Vector3d(0.002 * t, 0.0, 0.1);  // 0.1 m/s, 10 cm up
    motion.robot.root[t].R = motion.robot.root[t].R * Eigen::AngleAxisd(0.2, Eigen::Vector3d::UnitX());
  }
  motion.robot.q(28, 10) = g1().joints[28].upper + 0.1;
  motion.partner.joints.at(5, kLeftElbow).x() += 0.03;
  const auto figures = grounding_metrics(motion, g1());
  EXPECT_NEAR(figures.at("sole_height"), 0.1, 0.03);
  EXPECT_NEAR(figures.at("foot_skate"), 0.1, 1e-9);
  EXPECT_EQ(figures.at("limit_violations"), 1.0);
  EXPECT_GT(figures.at("bone_change_max"), 1e-3);
  EXPECT_GT(figures.at("joint_speed_max"), 5.0);
  EXPECT_NEAR(figures.at("root_roll_max"), 0.2, 1e-9);
  EXPECT_NEAR(figures.at("root_tilt_max"), 0.2, 1e-9);
  motion = standing(30);
  for (int t = 0; t < 30; ++t) motion.partner.joints.frame(t).row(0).array() -= 1.95;  // he stands in the robot
  EXPECT_GT(grounding_metrics(motion, g1()).at("penetration_max"), 0.03);
}

TEST(GroundingMetrics, StepsOverTheLimitOfAJointsSpeedAreCounted) {
  const double limit = g1().joints[3].velocity / 50.0;  // rad a frame
  for (const auto& [share, expected] : {std::pair{1.0, 0.0}, {1.001, 2.0}, {-1.001, 2.0}}) {
    PairedMotion motion = standing(30);
    motion.robot.q(3, 10) += share * limit;  // there and back
    EXPECT_EQ(grounding_metrics(motion, g1()).at("speed_violations"), expected) << share;
  }
  PairedMotion motion = standing(30);
  motion.robot.q(3, 10) += 2.0;
  RobotModel unlimited = g1();
  unlimited.joints[3].velocity = 0.0;
  EXPECT_EQ(grounding_metrics(motion, unlimited).at("speed_violations"), 0.0);
}

TEST(GroundingMetrics, OfAnotherRobotIsRefused) {
  PairedMotion motion = standing(10);
  motion.robot.q.conservativeResize(5, 10);
  EXPECT_THROW(grounding_metrics(motion, g1()), std::invalid_argument);
}

// The robot stands, people whose hands are where its hands are, and an object of one point in the left one.
PairedMotion holding(int frames) {
  PairedMotion motion;
  const RobotState state = g1().standing_state();
  motion.robot.rate_hz = 50.0;
  motion.robot.joint_names = g1().joint_names();
  motion.robot.q = g1().neutral.replicate(1, frames);
  motion.robot.root.assign(frames, state.X_WB);
  const PointTracks hands = frame_tracks(g1(), motion.robot,
                                         {g1().keypoints[g1().keypoint_index("left_hand")].frame,
                                          g1().keypoints[g1().keypoint_index("right_hand")].frame});
  HumanMotion person;
  person.joints = PointTracks(frames, kSmplJoints);
  for (int t = 0; t < frames; ++t) {
    person.joints.at(t, kLeftHand) = hands.at(t, 0);
    person.joints.at(t, kRightHand) = hands.at(t, 1);
  }
  motion.source_reactor = motion.source_partner = motion.partner = person;
  motion.object.keypoints = Eigen::Matrix3Xd::Zero(3, 1);
  motion.object.poses.assign(frames, Pose{.p = Eigen::Vector3d(hands.at(0, 0))});
  return motion;
}

double span(const PairedMotion& motion) {
  return (motion.source_reactor.joints.at(0, kLeftHand) - motion.source_reactor.joints.at(0, kRightHand)).norm();
}

TEST(ObjectMetrics, HandsThatKeepTheirDistancesHaveNoError) {
  const std::map<std::string, double> found = object_metrics(holding(4), g1());
  EXPECT_NEAR(found.at("object_distance_error"), 0.0, 1e-12);
  EXPECT_NEAR(found.at("object_distance_error.partner"), 0.0, 1e-12);
  for (const char* name : {"object_contact_f1_0.2", "object_contact_f1_0.35", "object_contact_f1_0.5"})
    EXPECT_EQ(found.at(name), 1.0) << name;
  PairedMotion none = holding(4);
  none.object = {};
  EXPECT_TRUE(object_metrics(none, g1()).empty());
  EXPECT_EQ(object_contact_counts(none, g1())[0].tn, 0);
}

TEST(ObjectMetrics, ErrorIsTheMeanOverFramesHandsAndKeypoints) {
  PairedMotion motion = holding(4);
  // The person's left hand was 0.3 m above the object in one frame of four: 0.3 / (4 * 2).
  motion.source_reactor.joints.at(2, kLeftHand).z() += 0.3;
  EXPECT_NEAR(object_metrics(motion, g1()).at("object_distance_error"), 0.3 / 8.0, 1e-12);
  motion.partner.joints.at(1, kLeftHand).x() += 0.1;
  EXPECT_NEAR(object_metrics(motion, g1()).at("object_distance_error.partner"), 0.1 / 8.0, 1e-12);
}

TEST(ObjectMetrics, ContactIsCountedPerFrameHandAndThreshold) {
  PairedMotion motion = holding(4);
  ASSERT_GT(span(motion), 0.5);                              // the object is at the left hand
  motion.source_reactor.joints.at(2, kLeftHand).z() += 0.3;  // outside 0.2, inside 0.35
  const std::array<ContactCounts, 3> counts = object_contact_counts(motion, g1());
  EXPECT_EQ(counts[0].tp, 3);
  EXPECT_EQ(counts[0].fp, 1);
  EXPECT_EQ(counts[0].tn, 4);  // right hands
  EXPECT_EQ(counts[2].tp, 4);
  EXPECT_EQ(counts[2].fp, 0);
  motion.source_reactor = motion.source_partner;
  for (int t = 0; t < 4; ++t) motion.object.poses[t].p.z() += t < 2 ? 0.0 : 2.0;
  motion.source_reactor.joints.at(3, kLeftHand) = motion.object.poses[3].p;
  EXPECT_EQ(object_contact_counts(motion, g1())[0].fn, 1);
}

TEST(ObjectMetrics, NearestKeypointDecidesContact) {
  PairedMotion motion = holding(2);
  motion.object.keypoints = Eigen::Matrix3Xd::Constant(3, 2, 5.0);
  motion.object.keypoints.col(1).setZero();
  EXPECT_EQ(object_contact_counts(motion, g1())[0].tp, 2);
}

TEST(ObjectMetrics, OtherLengthsAreRefused) {
  PairedMotion motion = holding(4);
  motion.object.poses.pop_back();
  EXPECT_SENTENCE(test::thrown_message<std::invalid_argument>([&] { object_metrics(motion, g1()); }));
}

}  // namespace
}  // namespace duet
