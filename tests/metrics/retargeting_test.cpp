#include "duet/metrics/retargeting.h"

#include <cmath>
#include <set>

#include "duet/core/recording.h"
#include "duet/metrics/catalogue.h"
#include "duet/metrics/detector.h"
#include "duet/robots/kinematics.h"
#include "tests/metrics/points.h"
#include "tests/support.h"

namespace duet {
namespace {

const RobotModel& g1() {
  static const RobotModel model = load_robot(default_card_path());
  return model;
}

RobotMotion random_motion(int frames) {
  Random random(5, 5);
  RobotMotion motion;
  motion.joint_names = g1().joint_names();
  motion.q.resize(g1().dof(), frames);
  for (double& x : motion.q.reshaped()) x = random.uniform(-0.6, 0.6);
  for (int t = 0; t < frames; ++t) {
    Pose pose;
    pose.R = yaw_rotation(random.uniform(-1.0, 1.0));
    pose.p = Eigen::Vector3d(0.01 * t, random.uniform(-0.1, 0.1), 0.79);
    motion.root.push_back(pose);
  }
  return motion;
}

// A source whose responder has the robot's own points where robot and human correspond: every metric is then known.
PairedMotion faithful(int frames) {
  PairedMotion motion;
  motion.robot = random_motion(frames);
  motion.partner.joints = test::random_points(frames, kSmplJoints, 1);
  motion.source_partner = motion.partner;
  motion.source_reactor.joints = PointTracks(frames, kSmplJoints);
  std::vector<int> pair_frames, keypoint_frames;
  for (const RetargetPair& pair : g1().pairs) pair_frames.push_back(pair.frame);
  for (const Keypoint& keypoint : g1().keypoints) keypoint_frames.push_back(keypoint.frame);
  motion.reshaped = frame_tracks(g1(), motion.robot, pair_frames);
  const PointTracks keypoints = frame_tracks(g1(), motion.robot, keypoint_frames);
  for (int t = 0; t < frames; ++t)
    for (size_t k = 0; k < g1().keypoints.size(); ++k)
      motion.source_reactor.joints.at(t, g1().keypoints[k].smpl) = keypoints.at(t, static_cast<int>(k));
  return motion;
}

TEST(RetargetingMetrics, AreTheEighteenOfTheCatalogue) {
  const std::map<std::string, double> metrics = retargeting_metrics(faithful(20), g1());
  EXPECT_EQ(metrics.size(), 18U);
  for (const auto& [name, value] : metrics) EXPECT_EQ(metric_info(name).group, MetricGroup::kRetargeting) << name;
}

TEST(RetargetingMetrics, OfAFaithfulRetargetingArePerfect) {
  const PairedMotion motion = faithful(20);
  const std::map<std::string, double> metrics = retargeting_metrics(motion, g1());
  EXPECT_EQ(metrics.at("jpe"), 0.0);
  EXPECT_EQ(metrics.at("awd"), 0.0);
  EXPECT_EQ(metrics.at("contact_accuracy_0.5"), 1.0);
  EXPECT_EQ(metrics.at("large_angle_ratio"), large_angle_ratio(motion.robot.q.cwiseAbs()));
  EXPECT_EQ(metrics.at("angle_std"), angle_std(motion.robot.q.cwiseAbs()));
  EXPECT_EQ(metrics.at("jerk_mean"), jerk(motion.reshaped, 50.0).mean);
  EXPECT_EQ(metrics.at("jerk_std"), jerk(motion.reshaped, 50.0).std);
}

TEST(RetargetingMetrics, RolesAreInitiatorPartnerAndResponderRobot) {
  const PairedMotion motion = faithful(20);
  PairedMotion shifted = motion;
  for (int t = 0; t < 20; ++t) shifted.partner.joints.frame(t).colwise() += Eigen::Vector3d(9.0, 0.0, 0.0);
  const std::map<std::string, double> all = retargeting_metrics_all_readings(shifted, g1());
  EXPECT_EQ(all.at("jpe.world"), 0.0);            // the partner has no part in JPE
  EXPECT_NEAR(all.at("awd.within"), 0.0, 1e-12);  // each agent is unchanged,
  EXPECT_GT(all.at("awd.cross"), 5.0);            // their distances are not
  PairedMotion far = motion;
  for (Pose& pose : far.robot.root) pose.p.y() += 2.0;
  EXPECT_NEAR(retargeting_metrics(far, g1()).at("jpe"), 2.0, 1e-12);
}

TEST(RetargetingMetrics, ContactCountsStandBehindTheFigures) {
  PairedMotion motion = faithful(40);
  motion.source_partner.joints = test::random_points(40, kSmplJoints, 8);
  const std::array<ContactCounts, 3> counts = retargeting_contact_counts(motion, g1());
  const std::map<std::string, double> metrics = retargeting_metrics(motion, g1());
  for (size_t i = 0; i < counts.size(); ++i) {
    EXPECT_EQ(counts[i].tp + counts[i].fp + counts[i].fn + counts[i].tn, 80);
    const char* endings[] = {"0.2", "0.35", "0.5"};
    EXPECT_EQ(metrics.at(std::string("contact_accuracy_") + endings[i]), classification(counts[i]).accuracy);
  }
}

TEST(RetargetingMetrics, ReadingsAreUsed) {
  PairedMotion motion = faithful(20);
  for (int t = 0; t < 20; ++t) motion.reshaped.frame(t).colwise() += Eigen::Vector3d(0.0, 0.0, 0.5);
  motion.partner.joints = test::random_points(20, kSmplJoints, 9);
  const std::map<std::string, double> all = retargeting_metrics_all_readings(motion, g1());
  MetricReadings readings;
  readings.jpe_frame = JpeFrame::kPelvis;
  readings.awd_entries = AwdEntries::kCross;
  readings.large_angle = LargeAngle::kEntry;
  readings.angle_std = AngleStd::kMeanOfJoints;
  readings.jerk_scheme = JerkScheme::kCentral;
  const std::map<std::string, double> metrics = retargeting_metrics(motion, g1(), readings);
  EXPECT_NEAR(all.at("jpe.world"), 0.5, 1e-12);
  EXPECT_NEAR(metrics.at("jpe"), 0.0, 1e-12);
  EXPECT_EQ(metrics.at("jpe"), all.at("jpe.pelvis"));
  EXPECT_EQ(metrics.at("awd"), all.at("awd.cross"));
  EXPECT_EQ(metrics.at("large_angle_ratio"), all.at("large_angle_ratio.entry"));
  EXPECT_EQ(metrics.at("angle_std"), all.at("angle_std.mean_of_joints"));
  EXPECT_EQ(metrics.at("jerk_mean"), all.at("jerk_mean.central"));
  EXPECT_NE(all.at("jerk_mean.links.diff"), all.at("jerk_mean.diff"));
  EXPECT_NE(all.at("awd.with_hands.full"), all.at("awd.full"));
  EXPECT_TRUE(all.contains("contact_f1_0.35.source_frame"));
  EXPECT_TRUE(all.contains("large_angle_ratio.grouped.frame_mean"));
}

TEST(RetargetingMetrics, AreUndefinedWithoutContact) {
  PairedMotion motion = faithful(20);
  for (int t = 0; t < 20; ++t) motion.source_partner.joints.frame(t).colwise() += Eigen::Vector3d(9.0, 0.0, 0.0);
  motion.partner = motion.source_partner;
  const std::map<std::string, double> metrics = retargeting_metrics(motion, g1());
  EXPECT_TRUE(std::isnan(metrics.at("contact_f1_0.5")));
  EXPECT_EQ(metrics.at("contact_accuracy_0.5"), 1.0);
}

// Motions of other retargeters say nothing of a reshaped person.
TEST(RetargetingMetrics, WithoutAReshapedPersonJpeAloneIsUndefined) {
  PairedMotion motion = faithful(20);
  const std::map<std::string, double> whole = retargeting_metrics(motion, g1());
  motion.reshaped = {};
  for (const auto& [name, value] : retargeting_metrics(motion, g1())) {
    if (name == "jpe") {
      EXPECT_TRUE(std::isnan(value));
    } else {
      EXPECT_TRUE(value == whole.at(name) || (std::isnan(value) && std::isnan(whole.at(name)))) << name;
    }
  }
  const std::map<std::string, double> readings = retargeting_metrics_all_readings(motion, g1());
  EXPECT_TRUE(std::isnan(readings.at("jpe.pelvis")));
  EXPECT_TRUE(std::isfinite(readings.at("awd.full")));
}

TEST(RetargetingMetrics, OfTheRobotAloneAreThoseOfThePair) {
  const PairedMotion motion = faithful(20);
  const std::map<std::string, double> whole = retargeting_metrics(motion, g1());
  const std::map<std::string, double> alone = motion_metrics(motion.robot, g1());
  EXPECT_EQ(alone.size(), 4u);
  for (const auto& [name, value] : alone) EXPECT_EQ(value, whole.at(name)) << name;
}

TEST(RetargetingMetrics, RefuseMotionsThatDisagree) {
  const auto of = [](const PairedMotion& motion) {
    return test::thrown_message<std::invalid_argument>([&] { (void)retargeting_metrics(motion, g1()); });
  };
  const PairedMotion good = faithful(10);
  EXPECT_SENTENCE(of(PairedMotion()));
  PairedMotion bad = good;
  bad.partner.joints = good.partner.joints.slice(0, 9);
  EXPECT_SENTENCE(of(bad));
  bad = good;
  bad.reshaped = good.reshaped.slice(0, 9);
  EXPECT_SENTENCE(of(bad));
  bad = good;
  bad.source_reactor.joints.at(3, kLeftElbow).x() = std::nan("");
  EXPECT_SENTENCE(of(bad));
  bad = good;
  std::swap(bad.robot.joint_names[0], bad.robot.joint_names[1]);
  EXPECT_SENTENCE(of(bad));
}

TEST(HingeGroups, OfTheG1) {
  const std::vector<HingeGroup> groups = hinge_groups(g1());
  // 2 hips, 2 shoulders, 2 wrists and the waist of three hinges; 2 knees, 4 ankles, 2 elbows alone.
  EXPECT_EQ(groups.size(), 15U);
  int triples = 0;
  std::set<int> rows;
  for (const HingeGroup& group : groups) {
    triples += group.rows.size() == 3;
    rows.insert(group.rows.begin(), group.rows.end());
  }
  EXPECT_EQ(triples, 7);
  EXPECT_EQ(rows.size(), 29U);
}

// The angle of a group is that of the rotation that forward kinematics shows, whatever the fixed turns between hinges.
TEST(HingeGroups, GiveTheRotationOfTheLimb) {
  const RobotMotion motion = random_motion(10);
  const std::vector<HingeGroup> groups = hinge_groups(g1());
  const Eigen::MatrixXd magnitudes = grouped_magnitudes(motion.q, groups);
  Kinematics zero(g1()), moved(g1());
  zero.update(Pose{}, Eigen::VectorXd::Zero(g1().dof()));
  for (int t = 0; t < 10; ++t) {
    moved.update(Pose{}, motion.q.col(t));
    for (size_t g = 0; g < groups.size(); ++g) {
      const int last = groups[g].rows.back() + 1;
      const int before = g1().links[groups[g].rows.front() + 1].parent;
      const Eigen::Matrix3d R_zero = zero.R_WL(before).transpose() * zero.R_WL(last);
      const Eigen::Matrix3d R_moved = moved.R_WL(before).transpose() * moved.R_WL(last);
      const Eigen::AngleAxisd turn(R_moved * R_zero.transpose());
      EXPECT_NEAR(magnitudes(static_cast<int>(g), t), turn.angle(), 1e-9) << g;
    }
  }
}

TEST(Agents, HumanTracksAreSmplJoints) {
  const PointTracks joints = test::random_points(3, kSmplJoints, 2);
  const Agent agent = human_agent(joints);
  for (int t = 0; t < 3; ++t) {
    EXPECT_EQ(agent.lhand.col(t), joints.at(t, 22));
    EXPECT_EQ(agent.rhand.col(t), joints.at(t, 23));
    EXPECT_EQ(agent.head.col(t), joints.at(t, 15));
    EXPECT_EQ(agent.root.col(t), joints.at(t, 0));
    EXPECT_EQ(agent.torso.col(t), joints.at(t, 9));
    EXPECT_EQ(agent.lshoulder.col(t), joints.at(t, 16));
    EXPECT_EQ(agent.rshoulder.col(t), joints.at(t, 17));
  }
  EXPECT_SENTENCE(test::thrown_message<std::invalid_argument>([] { (void)human_agent(PointTracks(3, 22)); }));
}

TEST(Agents, RobotTracksAreItsFrames) {
  const RobotMotion motion = random_motion(4);
  std::vector<RobotState> states(4);
  for (int t = 0; t < 4; ++t) {
    states[t].X_WB = motion.root[t];
    states[t].q = motion.q.col(t);
  }
  const Agent a = robot_agent(g1(), motion), b = robot_agent(g1(), states);
  const PointTracks frames = frame_tracks(g1(), motion, {g1().track_frame("lhand"), g1().track_frame("torso")});
  for (int t = 0; t < 4; ++t) {
    EXPECT_EQ(a.lhand.col(t), frames.at(t, 0));
    EXPECT_EQ(a.torso.col(t), frames.at(t, 1));
    EXPECT_EQ(a.root.col(t), motion.root[t].p);
  }
  EXPECT_EQ(a.rhand, b.rhand);
  EXPECT_EQ(a.head, b.head);
  EXPECT_EQ(a.lshoulder, b.lshoulder);
  EXPECT_EQ(a.rshoulder, b.rshoulder);
}

TEST(Agents, RobotRefusesAnotherRobotsMotion) {
  RobotMotion motion = random_motion(4);
  std::swap(motion.joint_names[3], motion.joint_names[4]);
  EXPECT_SENTENCE(test::thrown_message<std::invalid_argument>([&] { (void)robot_agent(g1(), motion); }));
  motion = random_motion(4);
  motion.q.conservativeResize(29, 3);
  EXPECT_SENTENCE(test::thrown_message<std::invalid_argument>([&] { (void)robot_agent(g1(), motion); }));
  std::vector<RobotState> states(1);
  states[0].q = Eigen::VectorXd::Zero(12);
  EXPECT_SENTENCE(test::thrown_message<std::invalid_argument>([&] { (void)robot_agent(g1(), states); }));
}

}  // namespace
}  // namespace duet
