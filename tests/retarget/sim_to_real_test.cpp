#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "duet/retarget/solver/pair.h"
#include "duet/robots/roles.h"
#include "tests/motion/people.h"
#include "tests/support.h"

namespace duet {
namespace {

using test::thrown_message;

constexpr int kFrames = 90;
constexpr Phases kAct{40, 60};
constexpr double kAlgebra = 1e-12;

const RobotModel& robot_named(const std::string& name) {
  static const RobotModel g1 = load_robot(card_path("g1")), t1 = load_robot(card_path("t1"));
  return name == "g1" ? g1 : t1;
}

// Every joint moves in every frame; the root curves, sways and turns through more than half a circle.
PairedMotion moving(const RobotModel& robot, Phases phases = kAct) {
  PairedMotion motion;
  motion.clip_id = "x";
  motion.phases = phases;
  motion.robot.joint_names = robot.joint_names();
  motion.robot.q.resize(robot.dof(), kFrames);
  for (int t = 0; t < kFrames; ++t) {
    for (int j = 0; j < robot.dof(); ++j) motion.robot.q(j, t) = 0.3 * std::sin(0.11 * t + j);
    motion.robot.root.push_back(
        {.R = yaw_rotation(-2.5 + 0.06 * t) * Eigen::Quaterniond(Eigen::AngleAxisd(0.1, Eigen::Vector3d::UnitY())),
         .p = {0.02 * t, 0.3 * std::sin(0.05 * t), 0.75 + 0.01 * std::sin(0.3 * t)}});
  }
  motion.partner = test::moving_person(kFrames, 50.0, {1.0, 0.0, 0.0}, {-0.1, 0.0, 0.0});
  motion.source_partner = motion.partner;
  motion.source_reactor = test::moving_person(kFrames, 50.0, {0.0, 0.0, 0.0});
  motion.reshaped = PointTracks(kFrames, 16);
  motion.loss = {{"total", {2.0, 1.0}}};
  motion.settings = {{"mode", "paper"}};
  return motion;
}

std::vector<int> upper_body(const RobotModel& robot) {
  const std::vector<int> legs = leg_joints(robot);
  std::vector<int> upper;
  for (int j = 0; j < robot.dof(); ++j)
    if (!std::count(legs.begin(), legs.end(), j)) upper.push_back(j);
  return upper;
}

void expect_same_pose(const Pose& a, const Pose& b, int frame) {
  EXPECT_EQ(a.p, b.p) << frame;
  EXPECT_EQ(a.R.coeffs(), b.R.coeffs()) << frame;
}

TEST(SimToReal, ActIsUnchangedToTheBit) {
  for (const std::string name : {"g1", "t1"}) {
    const PairedMotion before = moving(robot_named(name)), after = prepare_for_real(before, robot_named(name));
    for (int t = kAct.act_begin; t < kAct.act_end; ++t) {
      EXPECT_EQ(after.robot.q.col(t), before.robot.q.col(t)) << t;
      expect_same_pose(after.robot.root[t], before.robot.root[t], t);
    }
  }
}

TEST(SimToReal, EverythingButTheRobotIsUnchangedToTheBit) {
  const PairedMotion before = moving(robot_named("g1")), after = prepare_for_real(before, robot_named("g1"));
  EXPECT_EQ(after.robot.frames(), kFrames);
  EXPECT_EQ(after.phases, before.phases);
  EXPECT_EQ(after.partner.joints.data(), before.partner.joints.data());
  EXPECT_EQ(after.source_partner.joints.data(), before.source_partner.joints.data());
  EXPECT_EQ(after.source_reactor.joints.data(), before.source_reactor.joints.data());
  EXPECT_EQ(after.reshaped.data(), before.reshaped.data());
  EXPECT_EQ(after.loss, before.loss);
  EXPECT_EQ(after.settings.at("mode"), "paper");
  EXPECT_EQ(after.settings.at("prepared"), "sim_to_real");
  EXPECT_EQ(after.settings.at("mild_yaw"), "0.35");
}

TEST(SimToReal, PreparationHasANeutralUpperBodyAndTheSameLegs) {
  for (const std::string name : {"g1", "t1"}) {
    const RobotModel& robot = robot_named(name);
    const PairedMotion before = moving(robot), after = prepare_for_real(before, robot);
    for (int t = 0; t < kAct.act_begin; ++t)
      for (const int j : leg_joints(robot)) EXPECT_EQ(after.robot.q(j, t), before.robot.q(j, t)) << t;
    for (int t = 0; t <= kAct.act_begin - kSimToRealRamp; ++t)
      for (const int j : upper_body(robot)) EXPECT_EQ(after.robot.q(j, t), robot.neutral[j]) << t;
  }
}

// Frame act_begin - 16 is neutral, the act's first is 16 equal steps away.
TEST(SimToReal, SixteenFramesLeadIntoTheAct) {
  const RobotModel& robot = robot_named("g1");
  const PairedMotion after = prepare_for_real(moving(robot), robot);
  for (int k = 0; k <= 16; ++k)
    for (const int j : upper_body(robot)) {
      const double act = after.robot.q(j, kAct.act_begin);
      EXPECT_NEAR(after.robot.q(j, kAct.act_begin - 16 + k), robot.neutral[j] + k / 16.0 * (act - robot.neutral[j]),
                  kAlgebra);
    }
}

// A straight line at an even pace, and at most .35 rad of turning, all of it by the shortest way.
TEST(SimToReal, TheRootWalksStraightAndTurnsMildly) {
  const RobotModel& robot = robot_named("g1");
  const PairedMotion before = moving(robot), after = prepare_for_real(before, robot);
  const Pose &first = before.robot.root.front(), &goal = before.robot.root[kAct.act_begin];
  for (int t = 0; t < kAct.act_begin; ++t) {
    const double s = static_cast<double>(t) / kAct.act_begin;
    EXPECT_NEAR((after.robot.root[t].p - (first.p + s * (goal.p - first.p))).norm(), 0.0, kAlgebra) << t;
    const double turn = std::remainder(yaw_of(after.robot.root[t].R) - yaw_of(goal.R), 2.0 * std::numbers::pi);
    EXPECT_LE(std::abs(turn), kSimToRealYaw + kAlgebra) << t;
  }
  EXPECT_NEAR(yaw_of(after.robot.root.front().R) - yaw_of(goal.R), -kSimToRealYaw, kAlgebra);  // it turned by 2.4
  const PairedMotion straight = prepare_for_real(before, robot, 0.0);
  for (int t = 0; t < kAct.act_begin; ++t) EXPECT_NEAR(yaw_of(straight.robot.root[t].R), yaw_of(goal.R), 1e-9) << t;
}

TEST(SimToReal, FollowUpStandsStillAndReturnsOverSixteenFrames) {
  const RobotModel& robot = robot_named("g1");
  const PairedMotion after = prepare_for_real(moving(robot), robot);
  const int last = kAct.act_end - 1;
  for (int t = kAct.act_end; t < kFrames; ++t) {
    expect_same_pose(after.robot.root[t], after.robot.root[last], t);
    for (const int j : leg_joints(robot)) EXPECT_EQ(after.robot.q(j, t), after.robot.q(j, last)) << t;
    const double s = std::min(1.0, (t - last) / 16.0);
    for (const int j : upper_body(robot))
      EXPECT_NEAR(after.robot.q(j, t), after.robot.q(j, last) + s * (robot.neutral[j] - after.robot.q(j, last)),
                  kAlgebra);
  }
}

TEST(SimToReal, ShortPhasesAreFilledAsFarAsTheyGo) {
  const RobotModel& robot = robot_named("g1");
  const PairedMotion brief = prepare_for_real(moving(robot, {4, 85}), robot);
  for (const int j : upper_body(robot)) {
    EXPECT_EQ(brief.robot.q(j, 0), robot.neutral[j]);
    const double act = brief.robot.q(j, 4), last = brief.robot.q(j, 84);
    EXPECT_NEAR(brief.robot.q(j, 1), robot.neutral[j] + 0.25 * (act - robot.neutral[j]), kAlgebra);
    EXPECT_NEAR(brief.robot.q(j, 89), last + 5.0 / 16.0 * (robot.neutral[j] - last), kAlgebra);
  }
  const PairedMotion act_alone = moving(robot, {0, kFrames}), same = prepare_for_real(act_alone, robot);
  EXPECT_EQ(same.robot.q, act_alone.robot.q);
}

TEST(SimToReal, WhatDoesNotFitIsRefused) {
  const RobotModel& robot = robot_named("g1");
  const auto refused = [&](const PairedMotion& motion, double mild_yaw = kSimToRealYaw) {
    return thrown_message<std::invalid_argument>([&] { (void)prepare_for_real(motion, robot, mild_yaw); });
  };
  EXPECT_SENTENCE(refused(moving(robot_named("t1"))));
  EXPECT_SENTENCE(refused(moving(robot, {40, 40})));
  EXPECT_SENTENCE(refused(moving(robot), -0.1));
  EXPECT_SENTENCE(refused(prepare_for_real(moving(robot), robot)));
}

TEST(GaussianFilter, ImpulseGivesTheNormalisedKernel) {
  Eigen::MatrixXd x = Eigen::MatrixXd::Zero(1, 9);
  x(0, 4) = 1.0;
  const Eigen::MatrixXd y = gaussian_filter(x);
  EXPECT_NEAR(y.sum(), 1.0, 1e-15);
  EXPECT_NEAR(y(0, 5) / y(0, 4), std::exp(-0.5 / (0.75 * 0.75)), 1e-15);
  EXPECT_NEAR(y(0, 6) / y(0, 4), std::exp(-0.5 * 4 / (0.75 * 0.75)), 1e-15);
  EXPECT_EQ(y(0, 5), y(0, 3));
  EXPECT_EQ(y(0, 1), 0.0);
  EXPECT_EQ(y(0, 7), 0.0);
}

TEST(GaussianFilter, KeepsConstantsToTheEndsAndLinesInside) {
  const Eigen::MatrixXd constant = Eigen::MatrixXd::Constant(3, 5, 0.7);
  EXPECT_LT((gaussian_filter(constant) - constant).cwiseAbs().maxCoeff(), 1e-15);
  const Eigen::RowVectorXd line = Eigen::RowVectorXd::LinSpaced(12, -1.0, 2.0);
  const Eigen::MatrixXd y = gaussian_filter(line);
  EXPECT_LT((y.middleCols(2, 8) - line.middleCols(2, 8)).cwiseAbs().maxCoeff(), 1e-15);
  EXPECT_GT(y(0, 0), line[0]);  // the first value repeats before the start
}

TEST(GaussianFilter, OneFrameStays) {
  EXPECT_NEAR(gaussian_filter(Eigen::MatrixXd::Constant(1, 1, 2.0))(0, 0), 2.0, 1e-15);
}

}  // namespace
}  // namespace duet
