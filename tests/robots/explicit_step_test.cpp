#include "duet/robots/explicit_step.h"

#include <gmock/gmock.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "duet/robots/dynamics.h"
#include "tests/robots/fixtures.h"
#include "tests/support.h"

namespace duet {
namespace {

using test::g1;

JointGains no_gains(const RobotModel& robot) {
  return {Eigen::VectorXd::Zero(robot.dof()), Eigen::VectorXd::Zero(robot.dof())};
}

JointGains card_gains(const RobotModel& robot) {
  JointGains gains = no_gains(robot);
  for (int j = 0; j < robot.dof(); ++j) {
    gains.kp[j] = robot.joints[j].kp;
    gains.kd[j] = robot.joints[j].kd;
  }
  return gains;
}

RobotModel bare(RobotModel robot) {
  for (RobotJoint& joint : robot.joints) joint.armature = 0.0;
  return robot;
}

int joint_named(const RobotModel& robot, const std::string& name) {
  const auto found = std::ranges::find(robot.joints, name, &RobotJoint::name);
  return static_cast<int>(found - robot.joints.begin());
}

// Largest speed after a fine nudge and `steps` steps of the linearised explicit law.
double speed_after(const RobotModel& robot, const JointGains& gains, double dt, int steps) {
  Eigen::MatrixXd mass(6 + robot.dof(), 6 + robot.dof());
  mass_matrix(robot, robot.standing_state(), mass);
  const Eigen::MatrixXd W = mass.inverse().bottomRightCorner(robot.dof(), robot.dof());
  Eigen::VectorXd q = Eigen::VectorXd::Zero(robot.dof()), v = Eigen::VectorXd::Constant(robot.dof(), 1e-3);
  for (int i = 0; i < steps; ++i) {
    v -= dt * (W * (gains.kp.cwiseProduct(q) + gains.kd.cwiseProduct(v)));
    q += dt * v;
  }
  return v.cwiseAbs().maxCoeff();
}

TEST(ExplicitStep, IsWhereTheLinearisedRobotBeginsToShake) {
  for (const bool armature : {true, false}) {
    const RobotModel robot = armature ? g1() : bare(g1());
    const JointGains gains = card_gains(robot);
    const double largest = largest_explicit_step(robot, robot.standing_state(), gains).largest;
    EXPECT_LT(speed_after(robot, gains, 0.98 * largest, 4000), 1e-2) << armature;
    EXPECT_GT(speed_after(robot, gains, 1.02 * largest, 4000), 1e3) << armature;
  }
}

// Steps of the damping alone with the card's kd, as they were found by hand in the standing pose [ms].
TEST(ExplicitStep, OfTheG1AreThoseOfItsSmallestInertias) {
  struct Known {
    const char* joint;
    double bare, with_armature;
  };
  const RobotModel heavy = g1(), light = bare(g1());
  for (const Known& known : {Known{"left_ankle_roll_joint", 0.32, 7.5}, Known{"left_wrist_roll_joint", 0.63, 7.9},
                             Known{"left_wrist_yaw_joint", 2.1, 11.0}, Known{"left_ankle_pitch_joint", 2.3, 9.6},
                             Known{"left_wrist_pitch_joint", 2.8, 12.0}}) {
    const int joint = joint_named(heavy, known.joint);
    JointGains gains = no_gains(heavy);
    gains.kd[joint] = heavy.joints[joint].kd;
    const auto step = [&](const RobotModel& robot) {
      return 1e3 * largest_explicit_step_of(robot, robot.standing_state(), gains, joint);
    };
    EXPECT_NEAR(step(light), known.bare, 0.04 * known.bare) << known.joint;
    EXPECT_NEAR(step(heavy), known.with_armature, 0.04 * known.with_armature) << known.joint;
    // One joint alone: the whole robot's bound is that joint's.
    const ExplicitStep whole = largest_explicit_step(light, light.standing_state(), gains);
    EXPECT_NEAR(1e3 * whole.largest, step(light), 1e-9);
    EXPECT_EQ(whole.joint, joint);
  }
}

TEST(GainsForExplicitStep, LowerOnlyWhatWouldShake) {
  const RobotModel robot = g1();
  const JointGains asked = card_gains(robot), gains = gains_for_explicit_step(robot, asked, 0.001);
  EXPECT_EQ(gains.kp, asked.kp);
  EXPECT_GE(largest_explicit_step(bare(robot), robot.standing_state(), gains).largest, 0.002);
  for (int j = 0; j < robot.dof(); ++j) {
    const bool shakes = robot.joints[j].name.find("ankle_roll") != std::string::npos ||
                        robot.joints[j].name.find("wrist_roll") != std::string::npos;
    if (shakes)
      EXPECT_LT(gains.kd[j], 0.5 * asked.kd[j]) << robot.joints[j].name;
    else
      EXPECT_GE(gains.kd[j], 0.6 * asked.kd[j]) << robot.joints[j].name;
    EXPECT_EQ(gains.kd[j], gains.kd[robot.roles.counterpart[j]]);
  }
  EXPECT_EQ(gains_for_explicit_step(robot, asked, 1e-5).kd, asked.kd);
}

TEST(GainsForExplicitStep, RefuseAStiffnessThatNoDampingHolds) {
  const RobotModel robot = g1();
  const auto said = [&](double step) {
    return test::thrown_message<std::invalid_argument>(
        [&] { gains_for_explicit_step(robot, card_gains(robot), step); });
  };
  EXPECT_THAT(said(0.02), ::testing::HasSubstr("which no damping makes hold at 20 ms"));
  EXPECT_THAT(said(0.0), ::testing::HasSubstr("expected a step above 0 s, found 0"));
}

TEST(ExplicitStep, NoGainsShakeNothingAndOthersRobotsAreRefused) {
  const RobotModel& robot = g1();
  const ExplicitStep none = largest_explicit_step(robot, robot.standing_state(), no_gains(robot));
  EXPECT_EQ(none.largest, std::numeric_limits<double>::infinity());
  EXPECT_EQ(none.joint, -1);
  EXPECT_THAT(test::thrown_message<std::invalid_argument>([&] {
                largest_explicit_step(robot, robot.standing_state(), {Eigen::VectorXd(3), {}});
              }),
              ::testing::HasSubstr("found 3 and 0"));
}

}  // namespace
}  // namespace duet
