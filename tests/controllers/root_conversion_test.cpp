#include "duet/controllers/root_conversion.h"

#include <numbers>

#include "tests/support.h"

namespace duet {
namespace {

constexpr double kTick = 0.02;

// A root that follows its forward command with a first-order lag, as the law's readings were compared.
struct Root {
  explicit Root(RootConversionLaw law, double lag = 0.35, double steps_from = 0.0)
      : conversion(law, interface_of(steps_from)), lag(lag) {
    state.X_WB.p.z() = 0.75;
    reference.X_WB.p = {0.0, 0.0, 0.75};
  }
  static VelocityInterface interface_of(double steps_from) {
    return {.forward = {-0.8, 1.2, steps_from},
            .lateral = {-0.5, 0.5, 0.0},
            .yaw = {-0.8, 0.8, 0.0},
            .height = {0.24, 0.74, 0.0},
            .height_offset = 0.014};
  }
  VelocityCommand tick() {
    const VelocityCommand command = conversion.update(state, reference, v_ref, 0.0);
    state.v_WB.x() += (command.forward - state.v_WB.x()) * kTick / lag;
    state.X_WB.p.x() += state.v_WB.x() * kTick;
    least = std::min(least, command.forward);
    flips += command.forward * last < 0.0 ? 1 : 0;
    if (command.forward != 0.0) last = command.forward;
    return command;
  }
  void run(double seconds) {
    for (int k = 0; k < std::lround(seconds / kTick); ++k) tick();
  }
  RootConversion conversion;
  double lag;
  RobotState state;
  Reference reference;
  Eigen::Vector3d v_ref = Eigen::Vector3d::Zero();
  double least = 0.0, last = 0.0;
  int flips = 0;
};

TEST(RootConversion, AsPrintedItNeverStops) {
  Root root(RootConversionLaw::kPrinted);
  root.reference.X_WB.p.x() = 1.0;
  root.run(25.0);
  EXPECT_GT(root.state.X_WB.p.x(), 1.3);
  EXPECT_GT(root.flips, 20);
}

TEST(RootConversion, AsAdoptedItStopsShortByAtMostTheBrakeDistance) {
  for (const double lag : {0.2, 0.35, 0.6}) {
    Root root(RootConversionLaw::kAdopted, lag);
    root.reference.X_WB.p.x() = 1.0;
    root.run(10.0);
    const double stopped = root.state.X_WB.p.x();
    EXPECT_LE(stopped, 1.0) << lag;
    EXPECT_GE(stopped, 1.0 - kBrakeDistance) << lag;
    EXPECT_EQ(root.flips, 1) << lag;
    EXPECT_EQ(root.least, -kReferenceSpeed);
    root.run(5.0);
    EXPECT_NEAR(root.state.X_WB.p.x(), stopped, 1e-3) << lag;
  }
}

TEST(RootConversion, StandsUntilTheGoalHasMoved) {
  Root root(RootConversionLaw::kAdopted);
  root.reference.X_WB.p.x() = 1.0;
  root.run(10.0);
  root.reference.X_WB.p.x() += 0.14;
  root.run(3.0);
  EXPECT_LT(root.state.X_WB.p.x(), 1.0);
  root.reference.X_WB.p.x() += 0.36;
  root.run(6.0);
  EXPECT_NEAR(root.state.X_WB.p.x(), 1.5, kBrakeDistance);
  EXPECT_LE(root.state.X_WB.p.x(), 1.5);
}

TEST(RootConversion, AShortGoalNeverStarts) {
  Root root(RootConversionLaw::kAdopted);
  root.reference.X_WB.p.x() = 0.19;
  root.run(2.0);
  EXPECT_EQ(root.state.X_WB.p.x(), 0.0);
}

TEST(RootConversion, BrakesForAtMostSixTenthsOfASecond) {
  Root root(RootConversionLaw::kAdopted);
  root.reference.X_WB.p.x() = 1.0;
  root.state.v_WB.x() = 0.5;
  (void)root.conversion.update(root.state, root.reference, root.v_ref, 0.0);
  root.state.X_WB.p.x() = 0.9;
  int braking = 0;
  for (int k = 0; k < 60; ++k)  // a robot that does not slow down
    braking += root.conversion.update(root.state, root.reference, root.v_ref, 0.0).forward < 0.0 ? 1 : 0;
  EXPECT_EQ(braking, kMostBrakeTicks);
}

TEST(RootConversion, DoesNotCommandSpeedsThatAreNotAnsweredBySteps) {
  Root root(RootConversionLaw::kAdopted, 0.35, 0.25);
  root.reference.X_WB.p.x() = 1.0;
  EXPECT_EQ(root.tick().forward, 0.25);
}

TEST(RootConversion, DirectFollowsAMovingGoal) {
  Root root(RootConversionLaw::kDirect, 0.35, 0.25);
  root.v_ref.x() = 0.4;
  for (int k = 0; k < 500; ++k) {
    root.reference.X_WB.p.x() += 0.4 * kTick;
    root.tick();
  }
  EXPECT_NEAR(root.state.X_WB.p.x(), root.reference.X_WB.p.x(), 0.16);
  root.v_ref.x() = 0.0;
  root.run(5.0);
  EXPECT_NEAR(root.state.X_WB.p.x(), root.reference.X_WB.p.x(), 0.16);
  EXPECT_NEAR(root.state.v_WB.x(), 0.0, 1e-3);
}

TEST(RootConversion, WorksInTheRobotsHeading) {
  Root root(RootConversionLaw::kAdopted);
  root.state.X_WB.R = yaw_rotation(std::numbers::pi / 2.0);
  root.reference.X_WB.R = yaw_rotation(std::numbers::pi / 2.0 + 0.1);
  root.reference.X_WB.p = {0.1, 1.0, 0.6};
  const VelocityCommand command = root.conversion.update(root.state, root.reference, root.v_ref, 0.0);
  EXPECT_EQ(command.forward, kReferenceSpeed);
  EXPECT_NEAR(command.lateral, -0.1, 1e-9);
  EXPECT_NEAR(command.yaw_rate, 0.15, 1e-9);
  EXPECT_NEAR(command.height, 0.586, 1e-9);
}

TEST(RootConversion, StaysWithinItsBounds) {
  for (const RootConversionLaw law :
       {RootConversionLaw::kPrinted, RootConversionLaw::kAdopted, RootConversionLaw::kDirect}) {
    Root root(law);
    root.reference.X_WB = {yaw_rotation(3.0), {100.0, -100.0, 3.0}};
    const VelocityCommand command = root.conversion.update(root.state, root.reference, {9.0, 9.0, 9.0}, 9.0);
    EXPECT_LE(command.forward, 1.2);
    EXPECT_GE(command.lateral, -0.5);
    EXPECT_LE(command.yaw_rate, 0.8);
    EXPECT_EQ(command.height, 0.74);
  }
}

TEST(RootConversion, TurnsTheShorterWay) {
  Root root(RootConversionLaw::kDirect);
  root.state.X_WB.R = yaw_rotation(3.1);
  root.reference.X_WB.R = yaw_rotation(-3.1);
  EXPECT_GT(root.conversion.update(root.state, root.reference, root.v_ref, 0.0).yaw_rate, 0.0);
}

TEST(VelocityCommandText, IsThreeOrFourNumbers) {
  const VelocityCommand command = parse_velocity_command("0.3, -0.1,0.5", 0.74);
  EXPECT_EQ(command.forward, 0.3);
  EXPECT_EQ(command.lateral, -0.1);
  EXPECT_EQ(command.yaw_rate, 0.5);
  EXPECT_EQ(command.height, 0.74);
  EXPECT_EQ(parse_velocity_command("0,0,0,0.5", 0.74).height, 0.5);
  for (const char* bad : {"", "1", "1,2", "1,2,x", "1,2,nan", "1,2,3,4,5", "1,,2"})
    EXPECT_SENTENCE(test::thrown_message<std::invalid_argument>([&] { parse_velocity_command(bad, 0.7); }));
}

}  // namespace
}  // namespace duet
