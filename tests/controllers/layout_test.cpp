// The input of each published controller's network, number by number, against the tables of its own documentation, and
// what becomes of its answer. The network is a fake.
#include "tests/controllers/layout.h"

#include <gmock/gmock.h>

#include <cmath>
#include <numbers>

#include "duet/controllers/observer.h"
#include "duet/core/require.h"
#include "tests/backends/allocation_count.h"
#include "tests/support.h"

namespace duet {
namespace {

using test::kNear;
using test::Layout;
using test::thrown_message;

TEST(RlGymLayout, IsThe47NumbersOfItsDeployment) {
  Layout l("rl_gym", 47, 12, {{"command", "0.5,-0.3,0.8"}});
  l.act();
  l.expect_action(33, 12, 0.0);
  EXPECT_NEAR(l.shown(45), 0.0, kNear);
  EXPECT_NEAR(l.shown(46), 1.0, kNear);
  l.act();
  l.expect_vector(0, 0.25 * l.state.w_WB_B, "gyro");
  l.expect_vector(3, l.gravity(), "gravity");
  l.expect_vector(6, {1.0, -0.6, 0.2}, "command");
  l.expect_joints(9, 21, 0.05, 12);
  l.expect_action(33, 12, 1.0);
  const double phase = 2.0 * std::numbers::pi * 0.02 / 0.8;
  EXPECT_NEAR(l.shown(45), std::sin(phase), kNear);
  EXPECT_NEAR(l.shown(46), std::cos(phase), kNear);
  for (int a = 0; a < 12; ++a) EXPECT_NEAR(l.command.q_target[a], l.neutral(a) + 0.25 * 0.1 * (a + 1), kNear);
  EXPECT_EQ(l.command.kp[3], 150.0);
  EXPECT_EQ(l.command.kd[3], 4.0);
}

TEST(HomieLayout, IsSixFramesOf76OldestFirstFromZeros) {
  Layout l("homie", 456, 12, {{"command", "0.3,-0.2,0.6,0.5"}});
  l.act();
  for (int i = 0; i < 380; ++i) EXPECT_EQ(l.shown(i), 0.0) << i;
  l.act();
  for (int i = 0; i < 304; ++i) EXPECT_EQ(l.shown(i), 0.0) << i;
  const int f = 380;
  l.expect_vector(f, {0.6, -0.4, 0.3}, "command");
  EXPECT_NEAR(l.shown(f + 3), 0.5, kNear);
  l.expect_vector(f + 4, 0.5 * l.state.w_WB_B, "gyro");
  l.expect_vector(f + 7, l.gravity(), "gravity");
  l.expect_joints(f + 10, f + 37, 0.05, 27);
  l.expect_action(f + 64, 12, 1.0);
  EXPECT_NEAR(l.shown(304 + 64), 0.0, kNear);  // the frame before: no action yet
  EXPECT_NEAR(l.shown(304 + 10), l.shown(f + 10), kNear);
}

TEST(HomieLayout, LegsAreTheNetworksTheRestFollowsTheReference) {
  Layout l("homie", 456, 12, {{"command", "0,0,0"}});
  l.memory.answered[0][0] = 1e4F;
  l.act();
  EXPECT_NEAR(l.command.q_target[0], -0.1 + 0.25 * 100.0, kNear);  // clipped
  EXPECT_NEAR(l.command.q_target[3], 0.3 + 0.25 * 0.4, kNear);
  for (int j = 12; j < 27; ++j) EXPECT_EQ(l.command.q_target[j], l.reference.q[j]) << l.robot->joints[j].name;
  EXPECT_EQ(l.command.kp[l.joint("left_knee")], 300.0);
  EXPECT_EQ(l.command.kp[l.joint("right_wrist_yaw")], 5.0);
  EXPECT_EQ(l.command.kd[l.joint("waist_yaw")], 5.0);
  l.act();
  EXPECT_EQ(l.shown(380 + 64), 100.0);
}

TEST(HomieLayout, YawScaleIsThatOfTrainingOrOfDeployment) {
  Layout l("homie", 456, 12, {{"command", "0,0,0.8"}, {"yaw_scale", "0.25"}});
  l.act();
  EXPECT_NEAR(l.shown(380 + 2), 0.2, kNear);
  EXPECT_NEAR(l.shown(380 + 3), 0.74, kNear);
}

// One scale for all three stays that of the other two.
TEST(PlaygroundLayout, YawScaleIsOfTheYawRateAlone) {
  Layout l("playground", 103, 29, {{"command", "0.8,-0.1,0.5"}, {"yaw_scale", "0.25"}});
  l.act();
  l.expect_vector(9, {0.8, -0.1, 0.125}, "command");
}

TEST(HomieLayout, WaistIsHeldOrFreeOnABodyThatHasOne) {
  const Descriptor homie = load_descriptor("homie");
  const auto robot = test::body("g1");
  for (const char* waist : {"locked", "free"}) {
    test::FakeMemory memory;
    const auto controller = make_descriptor_controller(
        homie, robot,
        std::make_unique<test::FakeNetwork>(std::vector<Port>{{"x", 456}}, std::vector<Port>{{"y", 12}}, memory),
        "fake", {{"waist", waist}, {"command", "0,0,0"}});
    Reference reference{robot->standing_state().X_WB, robot->neutral};
    reference.q[robot->joint_index("waist_pitch_joint")] = 0.2;
    JointCommand command;
    controller->reset(robot->standing_state());
    controller->act(robot->standing_state(), reference, command);
    EXPECT_EQ(command.q_target[robot->joint_index("waist_pitch_joint")], waist == std::string("free") ? 0.2 : 0.0);
    EXPECT_EQ(command.kp[robot->joint_index("waist_pitch_joint")], 300.0);
  }
}

TEST(Twist2Layout, IsTheReferenceTheRobotTenFramesAndTheReferenceAgain) {
  Layout l("twist2", 1432, 29);
  l.act();
  for (int i = 127; i < 1397; ++i) EXPECT_EQ(l.shown(i), 0.0) << i;
  l.go_on();
  l.act();
  const Eigen::Vector3d v = l.reference.X_WB.R.conjugate() * Eigen::Vector3d(0.5, 1.0, 0.0);
  for (const int first : {0, 1397}) {
    EXPECT_NEAR(l.shown(first), v.x(), kNear);
    EXPECT_NEAR(l.shown(first + 1), v.y(), kNear);
    EXPECT_NEAR(l.shown(first + 2), l.reference.X_WB.p.z(), kNear);
    const Eigen::Vector2d tilt = roll_pitch_of(l.reference.X_WB.R);
    EXPECT_NEAR(l.shown(first + 3), tilt.x(), kNear);
    EXPECT_NEAR(l.shown(first + 4), tilt.y(), kNear);
    EXPECT_NEAR(l.shown(first + 5), 0.5, 1e-5);
    for (int j = 0; j < 29; ++j) EXPECT_NEAR(l.shown(first + 6 + j), 2.0 + 0.01 * j, kNear);
  }
  l.expect_vector(35, 0.25 * l.state.w_WB_B, "gyro");
  EXPECT_NEAR(l.shown(38), -0.1, kNear);
  EXPECT_NEAR(l.shown(39), 0.2, kNear);
  for (int j = 0; j < 29; ++j) {
    const bool ankle = j == 4 || j == 5 || j == 10 || j == 11;
    EXPECT_NEAR(l.shown(40 + j), l.state.q[j] - l.neutral(j), kNear) << j;
    EXPECT_NEAR(l.shown(69 + j), ankle ? 0.0 : 0.05 * l.state.v[j], kNear) << j;
  }
  l.expect_action(98, 29, 1.0);
  // The newest frame of the history is the first tick's: its reference stood still, it had no action yet.
  const int last = 127 + 9 * 127;
  EXPECT_EQ(l.shown(last), 0.0);
  EXPECT_NEAR(l.shown(last + 40), l.shown(40), kNear);
  EXPECT_EQ(l.shown(last + 98), 0.0);
  for (int i = 127; i < last; ++i) EXPECT_EQ(l.shown(i), 0.0) << i;
}

TEST(Twist2Layout, ActionIsClippedForTheTargetAndRawInTheObservation) {
  Layout l("twist2", 1432, 29);
  l.memory.answered[0][7] = -30.0F;
  l.act();
  EXPECT_NEAR(l.command.q_target[7], -5.0, kNear);
  EXPECT_NEAR(l.command.q_target[16], 0.4 + 0.5 * 1.7, kNear);
  l.act();
  EXPECT_EQ(l.shown(98 + 7), -30.0);
}

TEST(PlaygroundLayout, IsThe103NumbersWithTheVelocityOfTheInertialUnit) {
  Layout l("playground", 103, 29, {{"command", "0.8,-0.1,0.5"}});
  l.act();
  const Eigen::Vector3d velocity =
      l.state.X_WB.R.conjugate() * l.state.v_WB + l.state.w_WB_B.cross(Eigen::Vector3d(0.04525, 0, -0.08339));
  l.expect_vector(0, velocity, "velocity");
  l.expect_vector(3, l.state.w_WB_B, "gyro");
  l.expect_vector(6, l.gravity(), "gravity");
  l.expect_vector(9, {0.8, -0.1, 0.5}, "command");
  l.expect_joints(12, 41, 1.0, 29);
  l.expect_action(70, 29, 0.0);
  EXPECT_NEAR(l.shown(99), 1.0, kNear);
  EXPECT_NEAR(l.shown(100), -1.0, kNear);
  l.act();
  const double step = 2.0 * std::numbers::pi * 1.5 * 0.02;
  EXPECT_NEAR(l.shown(99), std::cos(step), kNear);
  EXPECT_NEAR(l.shown(100), -std::cos(step), kNear);
  EXPECT_NEAR(l.shown(101), std::sin(step), kNear);
  EXPECT_NEAR(l.shown(102), -std::sin(step), kNear);
  EXPECT_NEAR(l.command.q_target[14], 0.073 + 0.5 * 1.5, kNear);
  EXPECT_EQ(l.command.kp[4], 20.0);
  EXPECT_EQ(l.command.kd[5], 0.2);
}

TEST(GmtLayout, IsTwentyFramesAheadTheRobotAndTwentyFramesBack) {
  Layout l("gmt", 2154, 23);
  l.act();
  l.act();
  for (int step = 0; step < 20; ++step) {
    const int first = 30 * step;
    EXPECT_NEAR(l.shown(first), l.reference.X_WB.p.z(), kNear);
    EXPECT_NEAR(l.shown(first + 2), roll_pitch_of(l.reference.X_WB.R).y(), kNear);
    for (int i = 3; i < 7; ++i) EXPECT_NEAR(l.shown(first + i), 0.0, kNear);
    EXPECT_NEAR(l.shown(first + 7), 2.0, kNear);
    EXPECT_NEAR(l.shown(first + 29), l.reference.q[l.joint("right_elbow")], kNear);
  }
  l.expect_vector(600, 0.25 * l.state.w_WB_B, "gyro");
  EXPECT_NEAR(l.shown(603), -0.1, kNear);
  EXPECT_NEAR(l.shown(605 + 4), l.state.q[4] + 0.2, kNear);
  EXPECT_EQ(l.shown(628 + 4), 0.0);
  EXPECT_NEAR(l.shown(628 + 3), 0.05 * l.state.v[3], kNear);
  l.expect_action(651, 23, 1.0);
  EXPECT_NEAR(l.shown(2154 - 74), 0.25 * l.state.w_WB_B.x(), kNear);
  EXPECT_EQ(l.shown(2154 - 75), 0.0);
  EXPECT_EQ(l.command.q_target[l.joint("left_wrist_yaw")], l.reference.q[l.joint("left_wrist_yaw")]);
}

TEST(GmtLayout, TorqueAtTheTickStaysWithinItsEffort) {
  Layout l("gmt", 2154, 23);
  l.memory.answered[0][0] = 10.0F;
  l.act();
  const double torque = 100.0 * (l.command.q_target[0] - l.state.q[0]) - 2.0 * l.state.v[0];
  EXPECT_NEAR(torque, 88.0, 1e-9);
}

TEST(BeyondMimicLayout, ShowsTheReferenceInTheRobotsAnchorInIsaacLabsOrder) {
  Layout l("beyond_mimic", 160, 29, {}, "obs", "actions");
  l.act();
  EXPECT_NEAR(l.shown(0), l.reference.q[l.joint("left_hip_pitch")], kNear);
  EXPECT_NEAR(l.shown(1), l.reference.q[l.joint("right_hip_pitch")], kNear);
  EXPECT_NEAR(l.shown(2), l.reference.q[l.joint("waist_yaw")], kNear);
  for (int j = 29; j < 58; ++j) EXPECT_EQ(l.shown(j), 0.0);
  Kinematics robot(*l.robot), wanted(*l.robot);
  robot.update(l.state.X_WB, l.state.q);
  wanted.update(l.reference.X_WB, l.reference.q);
  const int torso = l.robot->frame_index("torso_link");
  const Pose error = robot.frame_pose(torso).inverse() * wanted.frame_pose(torso);
  l.expect_vector(58, error.p, "anchor");
  const Eigen::Matrix3d R = error.R.toRotationMatrix();
  for (int k = 0; k < 6; ++k) EXPECT_NEAR(l.shown(61 + k), R(k / 2, k % 2), kNear);
  l.expect_vector(67, l.state.X_WB.R.conjugate() * l.state.v_WB, "velocity");
  l.expect_vector(70, l.state.w_WB_B, "gyro");
  EXPECT_NEAR(l.shown(73), l.state.q[0] + 0.312, kNear);
  EXPECT_NEAR(l.shown(102 + 2), l.state.v[12], kNear);
  l.act();
  l.expect_action(131, 29, 1.0);
  EXPECT_EQ(l.memory.shown[1][0], 1.0F);
  EXPECT_NEAR(l.command.q_target[l.joint("right_knee")], 0.669 + 0.3507 * 1.1, kNear);
}

// The terms of holosoma's observation stand in alphabetical order.
TEST(HolosomaLayout, IsThe100NumbersInAlphabeticalOrder) {
  for (const char* name : {"holosoma", "holosoma_fastsac"}) {
    Layout l(name, 100, 29, {{"command", "0.5,-0.3,0.8"}});
    l.act();
    l.expect_action(0, 29, 0.0);
    l.act();
    l.expect_action(0, 29, 1.0);
    l.expect_vector(29, 0.25 * l.state.w_WB_B, "gyro");
    EXPECT_NEAR(l.shown(32), 0.8, kNear);
    EXPECT_NEAR(l.shown(33), 0.5, kNear);
    EXPECT_NEAR(l.shown(34), -0.3, kNear);
    const double phase = 2.0 * std::numbers::pi * 0.02;
    EXPECT_NEAR(l.shown(35), std::cos(phase), kNear);
    EXPECT_NEAR(l.shown(36), -std::cos(phase), kNear);
    l.expect_joints(37, 66, 0.05, 29);
    l.expect_vector(95, l.gravity(), "gravity");
    EXPECT_NEAR(l.shown(98), std::sin(phase), kNear);
    EXPECT_NEAR(l.shown(99), -std::sin(phase), kNear);
    EXPECT_NEAR(l.command.q_target[l.joint("left_elbow")], 0.6 + 0.25 * 1.9, kNear);
  }
}

TEST(HolosomaLayout, StandsWithBothFeetAtHalfOfTheCycle) {
  Layout l("holosoma", 100, 29, {{"command", "0.005,0,0.005"}});
  for (int tick = 0; tick < 3; ++tick) {
    l.act();
    for (const int i : {32, 33, 34}) EXPECT_EQ(l.shown(i), 0.0) << i;
    for (const int i : {35, 36}) EXPECT_NEAR(l.shown(i), -1.0, kNear) << i;
    for (const int i : {98, 99}) EXPECT_NEAR(l.shown(i), 0.0, kNear) << i;
  }
}

TEST(FalconLayout, IsFiveFramesOf115OldestFirstFromZeros) {
  Layout l("falcon", 575, 29, {{"command", "0.5,-0.3,0.8,0.7"}});
  l.act();
  for (int i = 0; i < 460; ++i) EXPECT_EQ(l.shown(i), 0.0) << i;
  l.act();
  const int f = 460;
  l.expect_action(f, 29, 1.0);
  l.expect_vector(f + 29, 0.25 * l.state.w_WB_B, "gyro");
  EXPECT_NEAR(l.shown(f + 32), 0.8, kNear);
  EXPECT_NEAR(l.shown(f + 33), 1.4, kNear);
  EXPECT_NEAR(l.shown(f + 34), 0.5, kNear);
  EXPECT_NEAR(l.shown(f + 35), -0.3, kNear);
  EXPECT_EQ(l.shown(f + 36), 1.0);
  for (int i = 0; i < 3; ++i) EXPECT_NEAR(l.shown(f + 37 + i), l.reference.q[12 + i], kNear);
  l.expect_joints(f + 40, f + 69, 0.05, 29);
  l.expect_vector(f + 98, l.gravity(), "gravity");
  for (int i = 0; i < 14; ++i) EXPECT_NEAR(l.shown(f + 101 + i), l.reference.q[15 + i], kNear);
}

TEST(FalconLayout, LegsAndWaistActAroundTheDefaultArmsAroundTheReference) {
  Layout l("falcon", 575, 29, {{"command", "0,0,0"}});
  l.act();
  for (int j = 0; j < 29; ++j)
    EXPECT_NEAR(l.command.q_target[j], (j < 15 ? l.neutral(j) : l.reference.q[j]) + 0.25 * 0.1 * (j + 1), kNear) << j;
  EXPECT_EQ(l.shown(460 + 36), 0.0);
  EXPECT_NEAR(l.shown(460 + 33), 1.5, kNear);
}

TEST(FalconDecLocoLayout, IsThe102NumbersWithOnePhaseThatHoldsAtZero) {
  Layout l("falcon_dec_loco", 102, 15, {{"command", "0.5,-0.3,0.8"}});
  l.act();
  l.act();
  l.expect_action(0, 15, 1.0);
  l.expect_vector(15, 0.25 * l.state.w_WB_B, "gyro");
  EXPECT_NEAR(l.shown(18), 0.8, kNear);
  EXPECT_NEAR(l.shown(19), 0.5, kNear);
  EXPECT_NEAR(l.shown(20), -0.3, kNear);
  EXPECT_EQ(l.shown(21), 1.0);
  for (int i = 0; i < 3; ++i) EXPECT_NEAR(l.shown(22 + i), l.reference.q[12 + i], kNear);
  const double phase = 2.0 * std::numbers::pi * 0.02 / 0.9;
  EXPECT_NEAR(l.shown(25), std::cos(phase), kNear);
  l.expect_joints(26, 55, 0.05, 29);
  l.expect_vector(84, l.gravity(), "gravity");
  for (int i = 0; i < 14; ++i) EXPECT_NEAR(l.shown(87 + i), l.reference.q[15 + i], kNear);
  EXPECT_NEAR(l.shown(101), std::sin(phase), kNear);
  for (int j = 15; j < 29; ++j) EXPECT_EQ(l.command.q_target[j], l.reference.q[j]) << j;
  Layout standing("falcon_dec_loco", 102, 15, {{"command", "0,0,0"}});
  standing.act();
  standing.act();
  EXPECT_EQ(standing.shown(21), 0.0);
  EXPECT_NEAR(standing.shown(25), 1.0, kNear);
  EXPECT_NEAR(standing.shown(101), 0.0, kNear);
}

// Each term has its own five frames, the first repeated.
TEST(UnitreeRlLabLayout, IsSixTermsOfFiveFramesInIsaacLabsOrder) {
  Layout l("unitree_rl_lab", 480, 29, {{"command", "0.5,-0.3,0.1"}});
  l.act();
  for (int k = 0; k < 5; ++k) {
    l.expect_vector(3 * k, 0.2 * l.state.w_WB_B, "gyro");
    l.expect_vector(15 + 3 * k, l.gravity(), "gravity");
    l.expect_vector(30 + 3 * k, {0.5, -0.3, 0.1}, "command");
    EXPECT_NEAR(l.shown(45 + 29 * k + 1), l.state.q[6] + 0.1, kNear);     // right hip pitch
    EXPECT_NEAR(l.shown(190 + 29 * k + 2), 0.05 * l.state.v[12], kNear);  // waist yaw
    l.expect_action(335 + 29 * k, 29, 0.0);
  }
  l.act();
  l.expect_action(335 + 3 * 29, 29, 0.0);
  l.expect_action(335 + 4 * 29, 29, 1.0);
  EXPECT_NEAR(l.command.q_target[l.joint("right_knee")], 0.3 + 0.25 * 1.1, kNear);
  EXPECT_EQ(l.command.kp[l.joint("right_knee")], 150.0);
}

TEST(UnitreeRlMjlabLayout, IsThe96NumbersWithoutScales) {
  Layout l("unitree_rl_mjlab", 96, 29, {{"command", "0.5,-0.3,0.8"}});
  l.act();
  l.act();
  l.expect_vector(0, l.state.w_WB_B, "gyro");
  l.expect_vector(3, l.gravity(), "gravity");
  l.expect_vector(6, {0.5, -0.3, 0.8}, "command");
  l.expect_joints(9, 38, 1.0, 29);
  l.expect_action(67, 29, 1.0);
  EXPECT_NEAR(l.command.q_target[12], 0.35 * 1.3, kNear);
}

TEST(RlSarDanceLayout, ShowsTheReferenceAndTheAnchorsAttitudeInIsaacLabsOrder) {
  Layout l("rl_sar_dance", 154, 29);
  l.act();
  l.act();
  EXPECT_NEAR(l.shown(2), l.reference.q[l.joint("waist_yaw")], kNear);
  for (int j = 29; j < 58; ++j) EXPECT_EQ(l.shown(j), 0.0);
  Kinematics robot(*l.robot), wanted(*l.robot);
  robot.update(l.state.X_WB, l.state.q);
  wanted.update(l.reference.X_WB, l.reference.q);
  const int torso = l.robot->frame_index("torso_link");
  const Eigen::Matrix3d R = (robot.frame_pose(torso).inverse() * wanted.frame_pose(torso)).R.toRotationMatrix();
  for (int k = 0; k < 6; ++k) EXPECT_NEAR(l.shown(58 + k), R(k / 2, k % 2), kNear);
  l.expect_vector(64, l.state.w_WB_B, "gyro");
  EXPECT_NEAR(l.shown(67), l.state.q[0] + 0.312, kNear);
  EXPECT_NEAR(l.shown(96 + 2), l.state.v[12], kNear);
  l.expect_action(125, 29, 1.0);
}

}  // namespace
}  // namespace duet
