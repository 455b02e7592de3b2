#include "duet/hardware/robot_guard.h"

#include <gmock/gmock.h>

#include "tests/backends/allocation_count.h"
#include "tests/hardware/guarded_twin.h"
#include "tests/support.h"

namespace duet {
namespace {

using test::GuardedTwin;
using ::testing::HasSubstr;

int elbow() { return test::g1()->roles.arms[0][3]; }

TEST(RobotGuard, FromListeningToRunning) {
  GuardedTwin robot;
  robot.tick();
  EXPECT_EQ(robot.state(), SafetyState::kListen);
  EXPECT_FALSE(robot.wire.has_writer());
  robot.start();
  EXPECT_EQ(robot.state(), SafetyState::kRun) << stop_cause_name(robot.cause());
  EXPECT_EQ(robot.bad_frames, 0);
  EXPECT_EQ(robot.twin.refused_frames(), 0);
}

TEST(RobotGuard, TheTwinWalksAndMovesItsArm) {
  GuardedTwin robot;
  robot.start();
  robot.message.command.root.forward = 0.2;
  robot.message.command.q[elbow()] += 0.4;
  robot.run_for(4.0);
  EXPECT_NEAR(robot.twin.root_speed(), 0.2, 1e-3);
  EXPECT_NEAR(robot.twin.q()[elbow()], test::g1()->neutral[elbow()] + 0.4, 0.02);
  EXPECT_LE(robot.largest_step, 0.5 * GuardedTwin::kDt + 1e-6);
}

TEST(RobotGuard, InADryRunNoWriterIsEverMade) {
  GuardSetup setup = test::twin_guard();
  setup.dry_run = true;
  GuardedTwin robot(setup);
  robot.start();
  robot.run_for(2.0);
  EXPECT_EQ(robot.state(), SafetyState::kReady);
  EXPECT_EQ(robot.wire.opened, 0);
  EXPECT_EQ(robot.wire.written, 0);
  EXPECT_GT(counted(robot.guard.status().clamps, ClampReason::kHold), 0);  // the pipeline ran all the same
}

TEST(RobotGuard, NothingIsWrittenBeforeArming) {
  GuardedTwin robot;
  robot.hold_key(RemoteKey::kR1);
  robot.hold_key(RemoteKey::kStart);
  robot.hold_key(RemoteKey::kA);
  robot.run_for(5.0);
  EXPECT_EQ(robot.wire.written, 0);
  robot.guard.arm();
  robot.tick();
  EXPECT_EQ(robot.wire.written, 1);
}

TEST(RobotGuard, ArmedItDamps) {
  GuardedTwin robot;
  robot.run_for(2.2);
  robot.guard.arm();
  robot.run_for(0.5);
  EXPECT_EQ(robot.state(), SafetyState::kArmed);
  EXPECT_EQ(robot.last.motor[3].kd, 8.0f);
  EXPECT_EQ(robot.last.motor[3].kp, 0.0f);
}

TEST(RobotGuard, AfterTheStopKeyTheWriterGoes) {
  GuardedTwin robot;
  robot.start();
  robot.hold_key(RemoteKey::kSelect);
  robot.tick();
  EXPECT_EQ(robot.state(), SafetyState::kDamp);
  robot.drop_key(RemoteKey::kSelect);
  robot.run_for(5.1);
  EXPECT_EQ(robot.state(), SafetyState::kListen);
  EXPECT_FALSE(robot.wire.has_writer());
}

TEST(RobotGuard, AForeignWriterRefusesArmingAndHoldsARun) {
  GuardedTwin before;
  before.wire.foreign = 1;
  before.start();
  EXPECT_EQ(before.state(), SafetyState::kListen);
  GuardedTwin during;
  during.start();
  during.wire.foreign = 1;
  EXPECT_LE(during.time_to_leave(SafetyState::kRun), 0.11);
  EXPECT_EQ(during.cause(), StopCause::kForeignWriter);
}

TEST(RobotGuard, OldAndRepeatedMessagesAreDropped) {
  GuardedTwin robot;
  robot.start();
  PlannerMessage old = robot.message;
  old.command.root.forward = 0.25;
  robot.plans = false;
  for (int k = 0; k < 50; ++k) {
    robot.guard.receive(old, robot.now);
    robot.tick();
  }
  EXPECT_EQ(robot.guard.status().old_messages, 50);
  EXPECT_EQ(robot.guard.status().limited.root.forward, 0.0);
}

TEST(RobotGuard, AMessageOfAnotherSizeIsNoSignOfLife) {
  GuardedTwin robot;
  robot.start();
  robot.message.command.q.resize(12);
  EXPECT_NEAR(robot.time_to_leave(SafetyState::kRun), 0.6, 0.03);
  EXPECT_EQ(robot.cause(), StopCause::kPlannerAge);
}

TEST(RobotGuard, ANewRunDoesNotBeginWithAnOldCommand) {
  GuardedTwin robot;
  robot.message.command.root.forward = 0.25;
  robot.message.command.q[elbow()] += 0.8;
  robot.start();  // the planner asked all the time
  EXPECT_LT(robot.twin.root_speed(), 0.1);
  EXPECT_LE(robot.largest_step, 0.5 * GuardedTwin::kDt + 1e-6);
}

TEST(RobotGuard, ATickDoesNotAllocate) {
  if (!test::allocations_are_counted()) GTEST_SKIP() << "not run: the sanitizer has a malloc of its own";
  GuardedTwin robot(test::twin_guard(true));
  robot.start();
  ASSERT_EQ(robot.state(), SafetyState::kRun);
  for (int k = 0; k < 20; ++k) {
    robot.now += GuardedTwin::kDt;
    robot.step_twin();
    robot.plan();
    robot.see();
    robot.guard.receive(robot.twin.odometry(robot.now));
    const long before = test::allocation_count();
    robot.guard.tick(robot.now);
    EXPECT_EQ(test::allocation_count(), before);
  }
}

TEST(RobotGuard, RefusesWhatItCannotGuard) {
  const auto refusal = [](const std::function<void(GuardSetup&)>& spoil) {
    GuardSetup setup = test::twin_guard();
    spoil(setup);
    return test::thrown_message<std::invalid_argument>([&] { GuardedTwin robot(setup); });
  };
  EXPECT_THAT(refusal([](GuardSetup& s) { s.limiter.robot = nullptr; }), HasSubstr("guard: expected a robot"));
  EXPECT_THAT(refusal([](GuardSetup& s) { s.limiter.robot = load_shared_robot("g1_12dof"); }),
              HasSubstr("expected a robot of 29 joints"));
  EXPECT_THAT(refusal([](GuardSetup& s) { s.stance.kp.resize(2); }), HasSubstr("expected a stance of 29"));
}

}  // namespace
}  // namespace duet
