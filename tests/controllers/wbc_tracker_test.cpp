// The motion that WBC-Sim tracks: legs, gait, and the reference with its legs replaced.
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "duet/controllers/stance.h"
#include "duet/controllers/vmc.h"
#include "duet/controllers/wbc_sim/observation.h"
#include "duet/controllers/wbc_sim/tracker.h"
#include "duet/robots/kinematics.h"
#include "tests/backends/small_robots.h"
#include "tests/controllers/standing.h"
#include "tests/support.h"

namespace duet {
namespace {

using test::g1;
using test::standing_reference;
using test::thrown_message;
using Vector6 = Eigen::Matrix<double, 6, 1>;

Vector6 leg_angles(const LegChain& leg, const Eigen::VectorXd& q) {
  Vector6 angles;
  for (int i = 0; i < 6; ++i) angles[i] = q[leg.joints()[i]];
  return angles;
}

TEST(LegChain, FootPoseIsThatOfTheKinematics) {
  const Stance stance(*g1());
  Kinematics kinematics(*g1());
  Eigen::VectorXd q = g1()->neutral;
  for (int i = 0; i < g1()->dof(); ++i) q[i] += 0.1 * std::sin(i);
  kinematics.update({}, q);
  for (const Leg& leg : stance.legs()) {
    const LegChain chain(*g1(), leg);
    const Pose foot = chain.foot_pose(leg_angles(chain, q));
    EXPECT_LT((foot.p - kinematics.p_WL(leg.link)).norm(), 1e-12);
    EXPECT_LT((foot.R.toRotationMatrix() - kinematics.R_WL(leg.link)).norm(), 1e-12);
  }
}

TEST(LegChain, FindsTheAnglesOfAPoseNearTheStart) {
  const Stance stance(*g1());
  for (const Leg& leg : stance.legs()) {
    const LegChain chain(*g1(), leg);
    const Vector6 start = leg_angles(chain, g1()->neutral);
    Vector6 wanted = start, q = start;
    wanted += Vector6(0.1, 0.05, -0.08, 0.15, -0.05, 0.04);
    const Pose target = chain.foot_pose(wanted);
    for (int i = 0; i < 4; ++i) chain.solve(target, q);
    const Pose found = chain.foot_pose(q);
    EXPECT_LT((found.p - target.p).norm(), 1e-5);
    EXPECT_LT(found.R.angularDistance(target.R), 1e-4);
  }
}

TEST(LegChain, APoseOutOfReachKeepsWithinTheLimits) {
  const LegChain chain(*g1(), Stance(*g1()).legs()[0]);
  Vector6 q = leg_angles(chain, g1()->neutral);
  for (int i = 0; i < 50; ++i) chain.solve({Eigen::Quaterniond::Identity(), {2.0, 1.0, -3.0}}, q);
  for (int i = 0; i < 6; ++i) {
    const RobotJoint& joint = g1()->joints[chain.joints()[i]];
    EXPECT_TRUE(std::isfinite(q[i]));
    EXPECT_GE(q[i], joint.lower);
    EXPECT_LE(q[i], joint.upper);
  }
}

TEST(Gait, StandsWhileTheReferenceAndTheRobotRest) {
  Gait gait;
  for (int i = 0; i < 200; ++i) gait.update(Eigen::Vector3d::Zero(), {0.05, -0.05, 0.1});
  EXPECT_FALSE(gait.stepping());
  EXPECT_EQ(gait.feet()[0].lift, 0.0);
  EXPECT_NEAR(gait.feet()[0].y, 0.1185, 1e-12);
  EXPECT_NEAR(gait.feet()[1].y, -0.1185, 1e-12);
}

TEST(Gait, AFootOnTheGroundStaysWhereItIs) {
  const Eigen::Vector3d velocity(0.3, -0.1, 0.0);
  Gait gait;
  for (int i = 0; i < 300; ++i) gait.update(velocity, Eigen::Vector3d::Zero());  // the filter has settled
  for (int i = 0; i < 200; ++i) {
    const int stance = 1 - gait.swing_foot();
    const FootPlace before = gait.feet()[stance];
    gait.update(velocity, Eigen::Vector3d::Zero());
    if (stance != 1 - gait.swing_foot()) continue;
    const FootPlace after = gait.feet()[stance];
    EXPECT_NEAR(after.x + 0.02 * velocity.x(), before.x, 1e-9);
    EXPECT_NEAR(after.y + 0.02 * velocity.y(), before.y, 1e-9);
    EXPECT_EQ(after.lift, 0.0);
  }
}

TEST(Gait, AFootPassesUnderTheRootInTheMiddleOfItsSwing) {
  Gait gait;
  for (int tick = 0; tick < 300; ++tick) gait.update({0.4, 0.0, 0.0}, Eigen::Vector3d::Zero());
  int behind = 0, before = 0;
  for (int tick = 0; tick < 200; ++tick) {
    gait.update({0.4, 0.0, 0.0}, Eigen::Vector3d::Zero());
    const double x = gait.feet()[gait.swing_foot()].x, progress = gait.swing_progress();
    if (std::abs(progress - 0.5) < 1e-6) continue;
    EXPECT_EQ(x < 0.0, progress < 0.5) << progress;
    ++(progress < 0.5 ? behind : before);
  }
  EXPECT_GT(std::min(behind, before), 80);
}

TEST(Gait, EachFootSwingsOncePerCycleAndAsHighAsAsked) {
  Gait gait;
  double top[2] = {0.0, 0.0};
  for (int i = 0; i < 500; ++i) {
    gait.update({0.2, 0.0, 0.0}, Eigen::Vector3d::Zero());
    for (int side = 0; side < 2; ++side) top[side] = std::max(top[side], gait.feet()[side].lift);
  }
  for (const double height : top) EXPECT_NEAR(height, 0.08, 0.001);
}

TEST(Gait, StepsOnForTwoHalfCyclesAndThenStands) {
  Gait gait;
  for (int i = 0; i < 100; ++i) gait.update({0.3, 0.0, 0.0}, Eigen::Vector3d::Zero());
  ASSERT_TRUE(gait.stepping());
  int ticks = 0;
  while (gait.stepping() && ticks < 500) {
    gait.update(Eigen::Vector3d::Zero(), Eigen::Vector3d::Zero());
    ++ticks;
  }
  EXPECT_GT(ticks, 2 * 17);
  EXPECT_LT(ticks, 4 * 18 + 20);
  EXPECT_LT(std::abs(gait.velocity().x()), 0.02);
}

TEST(Gait, TheFootOfTheSideItGoesToLeavesFirst) {
  for (const double side : {1.0, -1.0}) {
    Gait gait;
    while (!gait.stepping()) gait.update({0.0, side * 0.2, 0.0}, Eigen::Vector3d::Zero());
    EXPECT_EQ(gait.swing_foot(), side > 0 ? 0 : 1);
  }
}

TEST(WbcTracker, AtRestTheLegsAreTheStandingOnes) {
  WbcTracker tracker(g1());
  tracker.reset(standing_reference(1.0, 2.0, 0.7));
  for (int i = 0; i < 10; ++i)
    tracker.update(g1()->standing_state(standing_reference(1.0, 2.0, 0.7).X_WB), standing_reference(1.0, 2.0, 0.7));
  // The stance is wider than the neutral pose's by less than 2 mm a side, over a leg of 0.6 m.
  EXPECT_LT((tracker.q() - g1()->neutral).cwiseAbs().maxCoeff(), 1e-2);
  EXPECT_LT(tracker.v().cwiseAbs().maxCoeff(), 1e-3);
}

TEST(WbcTracker, TheUpperBodyIsTheReferencesWithinTheLimits) {
  WbcTracker tracker(g1());
  Reference reference = standing_reference();
  const int elbow = g1()->joint_index("left_elbow_joint"), knee = g1()->joint_index("left_knee_joint");
  reference.q[elbow] = 99.0;
  reference.q[knee] = 2.0;  // a human's leg angles are not tracked
  tracker.reset(reference);
  EXPECT_EQ(tracker.q()[elbow], g1()->joints[elbow].upper);
  EXPECT_LT(tracker.q()[knee], 1.0);
}

// A robot at its place that moves at `speed` while the reference rests.
bool steps_at(double speed, const GaitOptions& gait) {
  WbcTracker tracker(g1(), gait);
  tracker.reset(standing_reference());
  RobotState state = g1()->standing_state();
  state.v_WB = {0.0, -speed, 0.0};
  tracker.update(state, standing_reference());
  return tracker.gait().stepping();
}

TEST(WbcTracker, WhereTheRobotIsGoingCountsAsDistanceForTheCaptureTime) {
  const GaitOptions capture{.start_distance = 0.12, .capture_time = 0.25};
  EXPECT_FALSE(steps_at(0.47, capture));
  EXPECT_TRUE(steps_at(0.49, capture));
  EXPECT_FALSE(steps_at(5.0, {.start_distance = 0.12}));
}

// A robot that keeps up with its reference goes nowhere.
TEST(WbcTracker, WhatTheReferenceMovesByIsNoDistance) {
  WbcTracker tracker(g1(), {.still_speed = 10.0, .still_turn = 10.0, .capture_time = 0.25});
  tracker.reset(standing_reference());
  for (int tick = 1; tick <= 50; ++tick) {
    const Reference reference = standing_reference(0.016 * tick, 0.0, 0.0);
    RobotState state = g1()->standing_state(reference.X_WB);
    state.v_WB = {0.8, 0.0, 0.0};
    tracker.update(state, reference);
    EXPECT_FALSE(tracker.gait().stepping()) << tick;
  }
}

// Heading +y, forward at 0.4 m/s and to the left by 0.3 rad/s.
TEST(WbcTracker, TheNetworkSeesTheReferenceAsItWillBeAfterTheLeadTime) {
  WbcTracker tracker(g1(), {.lead_time = 0.5});
  tracker.reset(standing_reference(0.0, 0.0, std::numbers::pi / 2));
  EXPECT_EQ(tracker.led_root().p, tracker.root().p);
  Reference reference;
  for (int tick = 1; tick <= 200; ++tick) {
    reference = standing_reference(0.0, 0.008 * tick, std::numbers::pi / 2);
    tracker.update(g1()->standing_state(reference.X_WB), reference);
  }
  EXPECT_LT((tracker.led_root().p - reference.X_WB.p - Eigen::Vector3d(0.0, 0.2, 0.0)).norm(), 1e-6);
  EXPECT_LT(tracker.led_root().R.angularDistance(reference.X_WB.R), 1e-6);
  WbcSensors sensors;
  read_sensors(g1()->standing_state(reference.X_WB), tracker, sensors);
  EXPECT_LT((sensors.root_error - Eigen::Vector3d(0.2, 0.0, 0.0)).norm(), 1e-6);  // in the robot's frame
  for (int tick = 1; tick <= 200; ++tick) {
    reference = standing_reference(0.0, 0.0, 0.006 * tick);
    tracker.update(g1()->standing_state(reference.X_WB), reference);
  }
  EXPECT_NEAR(yaw_of(tracker.led_root().R), yaw_of(reference.X_WB.R) + 0.15, 1e-6);
}

TEST(WbcTracker, ALowerRootBendsTheKnees) {
  WbcTracker tracker(g1());
  Reference low = standing_reference();
  low.X_WB.p.z() = 0.3;
  tracker.reset(low);
  EXPECT_EQ(tracker.root().p.z(), g1()->bounds_of_root().lowest);
  EXPECT_GT(tracker.q()[g1()->joint_index("left_knee_joint")],
            g1()->neutral[g1()->joint_index("left_knee_joint")] + 0.2);
}

TEST(Gait, AFootIsOnTheGroundWhereItsSwingBeginsAndEndsAndHighestInTheMiddle) {
  Gait gait;
  for (int i = 0; i < 300; ++i) gait.update({0.2, 0.0, 0.0}, Eigen::Vector3d::Zero());
  for (int i = 0; i < 100; ++i) {
    gait.update({0.2, 0.0, 0.0}, Eigen::Vector3d::Zero());
    const double lift = gait.feet()[gait.swing_foot()].lift;
    const double share = std::sin(std::numbers::pi * gait.swing_progress());
    EXPECT_NEAR(lift, gait.options().swing_height * share * share, 1e-12) << gait.swing_progress();
  }
}

TEST(TrackerModel, OfARobotWhoseCardSaysNoBoundsIsRefused) {
  EXPECT_SENTENCE(
      test::thrown_message<std::invalid_argument>([] { const WbcTracker tracker(load_shared_robot("t1")); }));
}

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
