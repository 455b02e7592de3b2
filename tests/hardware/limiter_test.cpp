// One test for each clamp of the limiter with nobody near; those of a person are in limiter_laws_test.cpp.
#include "duet/hardware/safety/limiter.h"

#include <cmath>
#include <limits>

#include "tests/backends/allocation_count.h"
#include "tests/hardware/limited_robot.h"
#include "tests/support.h"

namespace duet {
namespace {

using test::LimitedRobot;
constexpr double kRounding = 1e-9;
constexpr double kNan = std::numeric_limits<double>::quiet_NaN();

int elbow() { return test::g1()->roles.arms[0][3]; }

TEST(Limiter, ACommandInsideEverythingPassesUnchanged) {
  LimitedRobot robot(test::nobody_near());
  robot.command.q[elbow()] += 0.001;
  for (int k = 0; k < 50; ++k) robot.move();
  EXPECT_NEAR(robot.out.q[elbow()], robot.command.q[elbow()], kRounding);
  for (std::size_t reason = 0; reason < kClampReasons; ++reason) EXPECT_EQ(robot.counts[reason], 0) << reason;
}

// The command whose number at `value` is bad is refused as a whole: the good speed before it stands.
void expect_refused(const std::function<void(MotionCommand&)>& spoil, ClampReason reason) {
  LimitedRobot robot(test::nobody_near());
  robot.command.root.forward = 0.1;
  for (int k = 0; k < 50; ++k) robot.tick();
  MotionCommand bad = robot.command;
  bad.stamp += 1.0;
  bad.root.forward = -0.2;
  spoil(bad);
  robot.limiter.tick(&bad, robot.input, robot.state, robot.out, robot.counts);
  EXPECT_EQ(robot.counted(reason), 1);
  EXPECT_NEAR(robot.out.root.forward, 0.1, kRounding);
}

TEST(Limiter, RefusesACommandWithANumberThatIsNotFinite) {
  for (const double bad : {kNan, std::numeric_limits<double>::infinity()}) {
    expect_refused([bad](MotionCommand& c) { c.q[3] = bad; }, ClampReason::kNotFinite);
    expect_refused([bad](MotionCommand& c) { c.root.lateral = bad; }, ClampReason::kNotFinite);
    expect_refused([bad](MotionCommand& c) { c.root.yaw_rate = bad; }, ClampReason::kNotFinite);
    expect_refused([bad](MotionCommand& c) { c.root.height = bad; }, ClampReason::kNotFinite);
    expect_refused([bad](MotionCommand& c) { c.root.forward = bad; }, ClampReason::kNotFinite);
    expect_refused([bad](MotionCommand& c) { c.stamp = bad; }, ClampReason::kNotFinite);
  }
}

TEST(Limiter, RefusesACommandOfAnotherSize) {
  expect_refused([](MotionCommand& c) { c.q.resize(12); }, ClampReason::kSize);
}

TEST(Limiter, RefusesACommandThatIsNotNewer) {
  expect_refused([](MotionCommand& c) { c.stamp -= 1.0; }, ClampReason::kStamp);
  expect_refused([](MotionCommand& c) { c.stamp -= 1.5; }, ClampReason::kStamp);
}

TEST(Limiter, RootSpeedsStopAtTheirBounds) {
  struct Case {
    VelocityCommand asked, allowed;
  };
  for (const Case& c : {Case{{9.0, 9.0, 9.0, 0.74}, {0.25, 0.15, 0.5, 0.74}},
                        Case{{-9.0, -9.0, -9.0, 0.74}, {-0.20, -0.15, -0.5, 0.74}}}) {
    LimitedRobot robot(test::nobody_near());
    robot.command.root = c.asked;
    for (int k = 0; k < 100; ++k) robot.tick();
    EXPECT_NEAR(robot.out.root.forward, c.allowed.forward, kRounding);
    EXPECT_NEAR(robot.out.root.lateral, c.allowed.lateral, kRounding);
    EXPECT_NEAR(robot.out.root.yaw_rate, c.allowed.yaw_rate, kRounding);
    EXPECT_GT(robot.counted(ClampReason::kRootSpeed), 0);
  }
}

TEST(Limiter, RootAccelerationAndJerkStopAtTheirBounds) {
  LimitedRobot robot(test::nobody_near());
  robot.command.root.forward = 0.25;
  double speed = 0.0, acceleration = 0.0, largest = 0.0;
  for (int k = 0; k < 100; ++k) {
    const double next = robot.tick().root.forward;
    const double rate = (next - speed) / 0.02;
    EXPECT_LE(std::abs(rate - acceleration), 5.0 * 0.02 + kRounding);
    acceleration = rate;
    largest = std::max(largest, rate);
    speed = next;
  }
  EXPECT_NEAR(largest, 0.5, kRounding);
  EXPECT_GT(robot.counted(ClampReason::kRootAcceleration), 0);
  EXPECT_GT(robot.counted(ClampReason::kRootJerk), 0);
}

TEST(Limiter, HeightTurnAndStopKeepTheirRates) {
  LimitedRobot robot(test::nobody_near());
  const HardwareLimits limits;  // not the limiter's own copy, which is what is asked
  const double dt = robot.limiter.setup().dt;
  robot.command.root = {0.25, 0.0, -0.5, 0.84};
  VelocityCommand before{0.0, 0.0, 0.0, limits.height};
  double height = 0.0, turn = 0.0, stop = 0.0;
  for (int k = 0; k < 400; ++k) {
    if (k == 200) robot.command.root = {0.0, 0.0, 0.5, 0.84};
    const VelocityCommand now = robot.tick().root;
    height = std::max(height, std::abs(now.height - before.height) / dt);
    turn = std::max(turn, std::abs(now.yaw_rate - before.yaw_rate) / dt);
    stop = std::max(stop, (before.forward - now.forward) / dt);
    before = now;
  }
  EXPECT_NEAR(before.yaw_rate, 0.5, 1e-6);
  EXPECT_LE(height, limits.height_rate + 1e-9);
  EXPECT_LE(turn, limits.yaw_acceleration + 1e-9);
  EXPECT_LE(stop, limits.stop_acceleration + 1e-9);
}

TEST(Limiter, HeldItKeepsItsHeight) {
  LimitedRobot robot(test::nobody_near());
  robot.command.root.height = 0.84;
  robot.input.share = 0.0;
  for (int k = 0; k < 50; ++k) robot.tick();
  EXPECT_EQ(robot.out.root.height, 0.74);
}

TEST(Limiter, TheHeightStaysWithinATenthOfItsMiddle) {
  for (const double asked : {0.3, 1.2}) {
    LimitedRobot robot(test::nobody_near());
    robot.command.root.height = asked;
    for (int k = 0; k < 100; ++k) robot.tick();
    EXPECT_NEAR(robot.out.root.height, asked < 0.74 ? 0.64 : 0.84, kRounding);
    EXPECT_GT(robot.counted(ClampReason::kHeight), 0);
  }
}

TEST(Limiter, AJointStopsBeforeItsLimit) {
  const RobotJoint& joint = test::g1()->joints[elbow()];
  for (const double asked : {-9.0, 9.0}) {
    LimitedRobot robot(test::nobody_near());
    robot.command.q[elbow()] = asked;
    for (int k = 0; k < 600; ++k) robot.move();
    EXPECT_NEAR(robot.out.q[elbow()], asked < 0.0 ? joint.lower + 0.05 : joint.upper - 0.05, 1e-6);
  }
}

TEST(Limiter, AJointLimitIsCountedWhereTheLeadDoesNotComeFirst) {
  LimiterSetup setup = test::nobody_near();
  setup.executed.kp.setZero();
  LimitedRobot robot(setup);
  robot.command.q[elbow()] = 9.0;
  robot.tick();
  EXPECT_EQ(robot.counted(ClampReason::kJointLimit), 1);
  EXPECT_EQ(robot.counted(ClampReason::kJointLead), 0);
}

TEST(Limiter, AJointIsNoFasterThanItsSpeedAndAcceleration) {
  LimitedRobot robot(test::nobody_near());
  robot.command.q[elbow()] += 0.6;
  double q = robot.input.state.q[elbow()], speed = 0.0, fastest = 0.0;
  for (int k = 0; k < 100; ++k) {
    const double next = robot.move().q[elbow()];
    const double rate = (next - q) / 0.02;
    EXPECT_LE(std::abs(rate - speed), 5.0 * 0.02 + kRounding);
    q = next;
    speed = rate;
    fastest = std::max(fastest, rate);
  }
  EXPECT_NEAR(fastest, 0.5, kRounding);
  EXPECT_GT(robot.counted(ClampReason::kJointSpeed), 0);
  EXPECT_GT(robot.counted(ClampReason::kJointAcceleration), 0);
}

TEST(Limiter, ATargetDoesNotLeadABlockedArm) {
  LimitedRobot robot(test::nobody_near());
  robot.command.q[elbow()] += 0.9;
  for (int k = 0; k < 200; ++k) robot.tick();  // the arm does not move
  const double torque = 60.0 * (robot.out.q[elbow()] - robot.input.state.q[elbow()]);
  EXPECT_NEAR(torque, 0.4 * test::g1()->joints[elbow()].effort, 1e-6);
  EXPECT_GT(robot.counted(ClampReason::kJointLead), 0);
  EXPECT_EQ(robot.counted(ClampReason::kJointTorque), 0);
}

TEST(Limiter, APushedArmIsHeldWithLowerGains) {
  LimitedRobot robot(test::nobody_near());
  robot.tick();
  robot.input.state.q[elbow()] += 0.5;
  const LimitedCommand& out = robot.tick();
  const double torque = out.kp[elbow()] * (out.q[elbow()] - robot.input.state.q[elbow()]);
  EXPECT_NEAR(std::abs(torque), 0.4 * test::g1()->joints[elbow()].effort, 1e-6);
  EXPECT_LT(out.kp[elbow()], 60.0);
  EXPECT_LT(out.kd[elbow()], 1.5);
  EXPECT_EQ(robot.counted(ClampReason::kJointTorque), 1);
}

TEST(Limiter, JointsThatAreNotExecutedHaveNoGainsAndTheirMeasuredAngle) {
  LimitedRobot robot(test::nobody_near());
  const int waist_pitch = test::g1()->roles.waist[2], knee = test::g1()->roles.legs[0][3];
  robot.command.q[waist_pitch] = 0.3;
  robot.command.q[knee] = 2.0;
  for (int k = 0; k < 20; ++k) robot.tick();
  for (const int joint : {waist_pitch, knee}) {
    EXPECT_EQ(robot.out.q[joint], robot.input.state.q[joint]);
    EXPECT_EQ(robot.out.kp[joint], 0.0);
    EXPECT_EQ(robot.out.kd[joint], 0.0);
  }
}

TEST(Limiter, OnHoldTheRootStopsAndTheArmsFreeze) {
  LimitedRobot robot(test::nobody_near());
  robot.command.root = {0.2, 0.1, 0.3, 0.74};
  robot.command.q[elbow()] += 0.9;
  for (int k = 0; k < 30; ++k) robot.move();
  robot.input.share = 0.0;
  for (int k = 0; k < 60; ++k) robot.move();
  const double frozen = robot.out.q[elbow()];
  robot.move();
  EXPECT_EQ(robot.out.q[elbow()], frozen);
  EXPECT_NEAR(robot.out.root.forward, 0.0, kRounding);
  EXPECT_NEAR(robot.out.root.lateral, 0.0, kRounding);
  EXPECT_NEAR(robot.out.root.yaw_rate, 0.0, kRounding);
  EXPECT_EQ(robot.counted(ClampReason::kHold), 61);
}

TEST(Limiter, AShareThatIsNotFiniteHolds) {
  LimitedRobot robot(test::nobody_near());
  robot.input.share = kNan;
  robot.command.root.forward = 0.2;
  EXPECT_EQ(robot.tick().root.forward, 0.0);
}

TEST(Limiter, WithoutOdometryTheRootDoesNotMove) {
  LimitedRobot robot(test::nobody_near());
  robot.input.odometry = false;
  robot.command.root.forward = 0.2;
  robot.command.root.lateral = 0.1;
  for (int k = 0; k < 20; ++k) robot.tick();
  EXPECT_EQ(robot.out.root.forward, 0.0);
  EXPECT_EQ(robot.out.root.lateral, 0.0);
  EXPECT_EQ(robot.counted(ClampReason::kNoOdometry), 20);
}

TEST(Limiter, TheFenceStopsWhatLeadsOutAndNotWhatLeadsIn) {
  LimitedRobot robot(test::nobody_near());
  robot.input.state.X_WB.p.x() = 1.95;
  robot.input.state.X_WB.R = yaw_rotation(0.5);
  robot.command.root.forward = 0.2;
  for (int k = 0; k < 100; ++k) robot.tick();
  const Eigen::Vector2d v_W = Eigen::Rotation2Dd(0.5) * Eigen::Vector2d(robot.out.root.forward, robot.out.root.lateral);
  EXPECT_NEAR(v_W.x(), 0.0, 1e-6);
  EXPECT_GT(v_W.y(), 0.05);
  EXPECT_EQ(robot.counted(ClampReason::kFence), 100);
  robot.command.root.forward = -0.2;
  for (int k = 0; k < 100; ++k) robot.tick();
  EXPECT_NEAR(robot.out.root.forward, -0.2, 1e-6);
}

TEST(Limiter, TheFenceHasTwoSides) {
  LimitedRobot robot(test::nobody_near());
  robot.input.state.X_WB.p.y() = 1.95;
  robot.command.root.lateral = 0.1;
  for (int k = 0; k < 100; ++k) robot.tick();
  EXPECT_NEAR(robot.out.root.lateral, 0.0, 1e-6);
}

// The way that it takes to stop lies inside the fence; where that way begins it is stopped already.
TEST(Limiter, TheFenceBeginsWhereStoppingTakesThePlace) {
  const LimiterSetup setup = test::nobody_near();
  const HardwareLimits& limits = setup.limits;
  const double begin = limits.fence_x - limits.forward * (limits.reaction_time + limits.stopping_time);
  for (const auto& [place, stopped] : {std::pair{begin, 1}, std::pair{std::nextafter(begin, 0.0), 0}}) {
    LimitedRobot robot(setup);
    robot.input.state.X_WB.p.x() = place;
    robot.command.root.forward = 0.2;
    robot.tick();
    EXPECT_EQ(robot.counted(ClampReason::kFence), stopped);
  }
}

// Both arms are asked through the trunk.
TEST(Limiter, ArmsStopBeforeTheBody) {
  LimitedRobot robot(test::nobody_near());
  const auto& arms = test::g1()->roles.arms;
  for (int side = 0; side < 2; ++side) {
    robot.command.q[arms[side][1]] = 0.0;
    robot.command.q[arms[side][2]] = side == 0 ? -1.5 : 1.5;
    robot.command.q[arms[side][3]] = -0.5;
  }
  BodyDistance distance(test::g1(), {}, {});
  double nearest = BodyGaps::kFar;
  for (int k = 0; k < 400; ++k) {
    robot.move();
    nearest = std::min(nearest, distance.measure(robot.input.state.X_WB, robot.out.q, nullptr, 0.0, false).self);
  }
  EXPECT_GT(robot.counted(ClampReason::kSelfCollision), 0);
  EXPECT_GT(nearest, 0.025);
}

TEST(Limiter, AnArmThatWouldTouchTheBodyLeavesTheOtherFree) {
  LimitedRobot robot(test::nobody_near());
  const auto& arms = test::g1()->roles.arms;
  robot.command.q[arms[0][1]] = -0.6;  // into the trunk
  robot.command.q[arms[1][0]] -= 1.0;  // ahead
  for (int k = 0; k < 400; ++k) robot.move();
  EXPECT_GT(robot.counted(ClampReason::kSelfCollision), 0);
  EXPECT_GT(std::abs(robot.out.q[arms[0][1]] - robot.command.q[arms[0][1]]), 0.1);
  EXPECT_NEAR(robot.out.q[arms[1][0]], robot.command.q[arms[1][0]], 1e-6);
  BodyDistance distance(test::g1(), HumanBody{}, {});
  EXPECT_GT(distance.measure(robot.input.state.X_WB, robot.out.q, nullptr, 0.0, false).self, 0.025);
}

TEST(Limiter, ReleaseOpensTheArmsAndThenStepsBack) {
  LimitedRobot robot(test::nobody_near());
  robot.command.q[elbow()] = 0.0;
  for (int k = 0; k < 200; ++k) robot.move();
  robot.input.release = true;
  robot.input.share = 0.0;
  EXPECT_NEAR(robot.move().root.forward, 0.0, kRounding);
  for (int k = 0; k < 300; ++k) robot.move();
  EXPECT_NEAR(robot.out.q[elbow()], test::g1()->neutral[elbow()], 1e-6);
  EXPECT_EQ(robot.out.root.forward, 0.0) << "a robot that is held stays where it is";
  robot.input.share = 0.3;
  for (int k = 0; k < 100; ++k) robot.move();
  EXPECT_NEAR(robot.out.root.forward, -0.1, 1e-6);
  EXPECT_GT(robot.counted(ClampReason::kRelease), 0);
}

TEST(Limiter, ATickDoesNotAllocate) {
  if (!test::allocations_are_counted()) GTEST_SKIP() << "not run: the sanitizer has a malloc of its own";
  LimitedRobot robot(test::beside_an_adult());
  const HumanJoints person = test::standing_adult({1.2, 0.0, 0.95});
  robot.input.person = &person;
  robot.tick();
  const long before = test::allocation_count();
  for (int k = 0; k < 10; ++k) robot.tick();
  EXPECT_EQ(test::allocation_count(), before);
}

TEST(Limiter, RefusesASetupThatIsWrong) {
  const auto refusal = [](const std::function<void(LimiterSetup&)>& spoil) {
    LimiterSetup setup = test::nobody_near();
    spoil(setup);
    return test::thrown_message<std::invalid_argument>([&] { Limiter limiter(setup); });
  };
  EXPECT_SENTENCE(refusal([](LimiterSetup& s) { s.robot = nullptr; }));
  EXPECT_SENTENCE(refusal([](LimiterSetup& s) { s.dt = 0.0; }));
  EXPECT_SENTENCE(refusal([](LimiterSetup& s) { s.executed.joints = {29}; }));
  EXPECT_SENTENCE(refusal([](LimiterSetup& s) { s.executed.kp.resize(3); }));
  EXPECT_SENTENCE(refusal([](LimiterSetup& s) { s.executed.kd[0] = -1.0; }));
  EXPECT_SENTENCE(refusal([](LimiterSetup& s) { s.person = true; }));
}

TEST(Limiter, RefusesToStartFromAnythingButMeasuredAngles) {
  const Limiter limiter(test::nobody_near());
  RobotState state = test::g1()->standing_state();
  state.q[0] = kNan;
  EXPECT_SENTENCE(test::thrown_message<std::invalid_argument>([&] { (void)limiter.start(state); }));
}

}  // namespace
}  // namespace duet
