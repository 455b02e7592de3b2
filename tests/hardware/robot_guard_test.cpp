#include "duet/hardware/guard/robot_guard.h"

#include "duet/hardware/guard/guard_loop.h"
#include "tests/backends/allocation_count.h"
#include "tests/hardware/guarded_twin.h"
#include "tests/support.h"

namespace duet {
namespace {

using test::GuardedTwin;

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

TEST(RobotGuard, AfterTheStopKeyItIsDampedOn) {
  GuardedTwin robot;
  robot.start();
  robot.hold_key(RemoteKey::kSelect);
  robot.tick();
  EXPECT_EQ(robot.state(), SafetyState::kDamp);
  robot.drop_key(RemoteKey::kSelect);
  robot.run_for(5.1);
  EXPECT_EQ(robot.state(), SafetyState::kListen);
  const long written = robot.wire.written;
  robot.run_for(1.0);
  EXPECT_EQ(robot.wire.written, written + 500);
  EXPECT_TRUE(robot.last_damps);
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

TEST(RobotGuard, AMessageForAnotherRobotIsNotKept) {
  GuardedTwin robot;
  PlannerMessage other = robot.message;
  other.sequence = 1;
  other.command.q = Eigen::VectorXd::Zero(12);
  robot.guard.receive(other, robot.now);
  EXPECT_EQ(robot.guard.planned().q.size(), kG1Motors) << "what the log writes";
  EXPECT_EQ(counted(robot.guard.status().clamps, ClampReason::kSize), 1);
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

TEST(StreamOrder, ARepeatedNumberIsNeverTakenAndAStreamThatBeginsAnewAfterAPauseIs) {
  StreamOrder order;
  EXPECT_TRUE(order.takes(7, 0.0));
  for (int k = 1; k < 500; ++k) EXPECT_FALSE(order.takes(7, 0.02 * k)) << "a planner that hangs";
  EXPECT_EQ(order.old(), 499);
  EXPECT_TRUE(order.takes(8, 10.0));
  EXPECT_FALSE(order.takes(1, 10.5)) << "no pause";
  EXPECT_FALSE(order.takes(2, 10.9));
  EXPECT_TRUE(order.takes(3, 11.1));
  EXPECT_EQ(order.restarts(), 1);
  EXPECT_FALSE(order.takes(3, 11.2));
  EXPECT_TRUE(order.takes(4, 11.2));
}

TEST(RobotGuard, APlannerAndAPerceptionThatWereStartedAnewAreHeardAgain) {
  GuardedTwin robot(test::twin_guard(true));
  robot.sees = robot.plans = false;
  PlannerMessage planner = robot.message;
  PersonMessage person = robot.person;
  const auto tell = [&](std::uint64_t sequence) {
    planner.sequence = person.sequence = sequence;
    planner.command.stamp = robot.now;
    robot.guard.receive(planner, robot.now);
    robot.guard.receive(person, robot.now);
  };
  tell(1'000'000);
  robot.run_for(1.1);
  tell(1);
  EXPECT_EQ(robot.guard.planner().sequence, 1'000'000U);
  tell(2);
  robot.tick();
  EXPECT_EQ(robot.guard.planner().sequence, 2U);
  EXPECT_GT(robot.guard.status().input.person_at, 1.0);
  EXPECT_EQ(robot.guard.status().restarts, 2);
  EXPECT_EQ(robot.guard.status().old_messages, 2);
}

TEST(RobotGuard, OldAndRepeatedMessagesOfPerceptionAreDropped) {
  GuardedTwin robot(test::twin_guard(true));
  robot.sees = false;
  robot.person.sequence = 5;
  robot.guard.receive(robot.person, robot.now);
  robot.tick();
  const double seen_at = robot.guard.status().input.person_at;
  robot.run_for(0.1);
  for (const std::uint64_t old : {5u, 4u}) {
    robot.person.sequence = old;
    robot.guard.receive(robot.person, robot.now);
  }
  robot.tick();
  EXPECT_EQ(robot.guard.status().input.person_at, seen_at);
  EXPECT_EQ(robot.guard.status().old_messages, 2);
}

TEST(RobotGuard, OdometryThatCallsItselfInvalidIsNotUsed) {
  GuardedTwin robot;
  robot.run_for(0.1);
  robot.measures = false;
  const double at = robot.guard.odometry().at;
  OdometrySample invalid = robot.twin.odometry(robot.now);
  invalid.X_WB.p.x() += 0.01;
  invalid.valid = false;
  robot.guard.receive(invalid);
  robot.tick();
  EXPECT_EQ(robot.guard.status().input.odometry_at, at);
  EXPECT_LT(robot.guard.odometry().X_WB.p.x(), 0.005);
}

TEST(RobotGuard, TheLimiterIsGivenNoOldOdometryAndNoOldPerson) {
  GuardedTwin robot(test::twin_guard(true));
  robot.run_for(0.2);
  EXPECT_TRUE(robot.guard.limiter_input().odometry && robot.guard.limiter_input().person != nullptr);
  robot.measures = robot.sees = false;
  robot.run_for(0.3);
  EXPECT_FALSE(robot.guard.limiter_input().odometry);
  EXPECT_EQ(robot.guard.limiter_input().person, nullptr);
}

TEST(RobotGuard, WhatTheRemoteControlSaidLastIsNoNewsWithoutAState) {
  GuardedTwin robot;
  robot.hold_key(RemoteKey::kR1);
  robot.run_for(0.1);
  robot.spoil = [](GuardedTwin::Frames& frames) { frames.clear(); };
  robot.run_for(0.05);
  EXPECT_LT(robot.guard.status().input.remote_at, robot.now - 0.04);
  EXPECT_LT(robot.guard.status().input.dead_man_at, robot.now - 0.04);
}

TEST(RobotGuard, AJointBeyondItsLimitKeepsItFromBeingReady) {
  GuardedTwin robot;
  robot.spoil = [](GuardedTwin::Frames& frames) {
    for (LowStateFrame& frame : frames) {
      frame.motor[3].q = static_cast<float>(test::g1()->joints[3].upper + 0.05);
      seal(frame);
    }
  };
  robot.run_for(3.0);
  EXPECT_EQ(robot.state(), SafetyState::kListen);
  EXPECT_EQ(robot.guard.status().safety.missing, "joint_range");
}

// A twin whose left elbow was left 0.6 rad from the stance, armed and damped; the key that stands it up was pressed.
struct Standing {
  explicit Standing(const GuardSetup& setup = test::twin_guard(), double person_at = 4.0) : robot(setup) {
    robot.person.joints = test::standing_adult({person_at, 0.0, 0.95});
    JointCommand command = test::g1()->default_command(test::g1()->neutral);
    command.q_target[elbow()] += 0.6;
    LowCommandFrame frame;
    build_command(command, 5, frame);
    robot.twin.obey(frame);
    robot.hold_key(RemoteKey::kR1);
    robot.run_for(2.2);
    robot.guard.arm();
    robot.run_for(0.1);
    robot.hold_key(RemoteKey::kStart);
    robot.tick();
    robot.drop_key(RemoteKey::kStart);
  }
  [[nodiscard]] double left() const { return robot.guard.joints().q_target[elbow()] - test::g1()->neutral[elbow()]; }
  GuardedTwin robot;
};

TEST(RobotGuard, StandingUpStopsWithoutTheDeadManSwitchAndGoesOnWithIt) {
  Standing standing;
  GuardedTwin& robot = standing.robot;
  robot.run_for(0.3);
  robot.drop_key(RemoteKey::kR1);
  robot.run_for(0.4);
  const double at = standing.left();
  EXPECT_GT(at, 0.2);
  robot.run_for(5.0);
  EXPECT_EQ(standing.left(), at);
  EXPECT_EQ(robot.state(), SafetyState::kStand);
  EXPECT_FALSE(robot.guard.status().input.stands);
  robot.hold_key(RemoteKey::kR1);
  robot.run_for(2.0);
  EXPECT_NEAR(standing.left(), 0.0, 1e-6);
  EXPECT_TRUE(robot.guard.status().input.stands);
}

TEST(RobotGuard, StandingUpKeepsItsDistanceFromAPerson) {
  Standing near(test::twin_guard(true), 0.55);
  const double at = near.left();
  near.robot.message.acting = true;  // what a planner says of the act counts while it runs
  near.robot.run_for(3.0);
  EXPECT_EQ(near.robot.state(), SafetyState::kStand);
  EXPECT_EQ(near.left(), at) << "somebody is within reach";
  EXPECT_EQ(near.robot.guard.status().share, 0.0);
  for (int k = 0; k < 100; ++k) {  // who goes away
    near.robot.person.joints.colwise() += Eigen::Vector3d(0.05, 0.0, 0.0);
    near.robot.run_for(0.034);
  }
  near.robot.run_for(2.0);
  EXPECT_NEAR(near.left(), 0.0, 1e-6);
  Standing unseen(test::twin_guard(true));
  unseen.robot.sees = false;
  unseen.robot.run_for(0.6);
  const double unseen_at = unseen.left();
  unseen.robot.run_for(2.0);
  EXPECT_EQ(unseen.left(), unseen_at) << "nobody says where the person is";
}

TEST(RobotGuard, FromStandingUpToRunningNoTargetStopsFasterThanItMay) {
  Standing standing;
  GuardedTwin& robot = standing.robot;
  robot.hold_key(RemoteKey::kA);
  robot.run_for(4.0);
  EXPECT_EQ(robot.state(), SafetyState::kRun);
  const double dt = GuardedTwin::kDt;
  EXPECT_LE(robot.largest_change, HardwareLimits{}.arm_acceleration * dt * dt + 2e-7);  // numbers on the wire are short
}

TEST(RobotGuard, AHoldBeforeItStoodStopsEveryJointAndDoesNotWalk) {
  Standing standing;
  GuardedTwin& robot = standing.robot;
  robot.run_for(0.3);
  robot.wire.foreign = 1;
  robot.run_for(1.0);
  EXPECT_EQ(robot.state(), SafetyState::kHold);
  const double at = standing.left();
  robot.run_for(10.0);
  EXPECT_EQ(robot.state(), SafetyState::kHold);
  EXPECT_EQ(standing.left(), at);
  EXPECT_GT(at, 0.1);
  EXPECT_GT(robot.last.motor[3].kp, 0.0f) << "it is held, not damped";
  const double dt = GuardedTwin::kDt;
  EXPECT_LE(robot.largest_change, HardwareLimits{}.arm_acceleration * dt * dt + 2e-7);
  robot.wire.foreign = 0;
  robot.run_for(0.2);
  robot.hold_key(RemoteKey::kStart);
  robot.run_for(3.0);
  EXPECT_EQ(robot.state(), SafetyState::kStand);
  EXPECT_NEAR(standing.left(), 0.0, 1e-6);
}

// The share of the card's stiffness that a knee is sent.
double stiffness(const GuardedTwin& robot) {
  const int knee = test::g1()->roles.legs[0][3];
  return robot.last.motor[knee].kp / robot.guard.setup().stance.kp[knee];
}

TEST(RobotGuard, GainsRiseWhileItStandsUpAndItStandsWithFullOnes) {
  GuardedTwin robot;
  robot.hold_key(RemoteKey::kR1);
  for (int again = 0; again < 2; ++again) {
    robot.run_for(2.2);
    robot.guard.arm();
    robot.tick();
    robot.hold_key(RemoteKey::kStart);
    robot.tick();
    robot.drop_key(RemoteKey::kStart);
    EXPECT_NEAR(stiffness(robot), 0.1, 1e-6);
    EXPECT_GT(robot.last.motor[3].kd, 0.0f) << "its damping is there at once";
    double before = 0.0;
    for (int k = 0; k < 499; ++k) {
      robot.tick();
      EXPECT_GT(stiffness(robot), before);
      EXPECT_FALSE(robot.guard.status().input.stands) << k;
      before = stiffness(robot);
    }
    robot.run_for(0.01);
    EXPECT_NEAR(stiffness(robot), 1.0, 1e-6);
    EXPECT_TRUE(robot.guard.status().input.stands);
    robot.guard.stop();  // damped, and stood up anew
    robot.run_for(5.1);
    ASSERT_EQ(robot.state(), SafetyState::kListen);
  }
  EXPECT_EQ(robot.bad_frames, 0);
}

// An arm that is stretched out ahead.
struct Reaching {
  explicit Reaching(const GuardSetup& setup = test::twin_guard()) : robot(setup) {
    robot.start();
    robot.message.command.q[shoulder()] = -0.9;
    robot.message.command.q[elbow()] = 0.9;
    robot.run_for(4.0);
  }
  static int shoulder() { return test::g1()->roles.arms[0][0]; }
  [[nodiscard]] double fed() const { return robot.last.motor[shoulder()].tau; }
  [[nodiscard]] double sags() const { return std::abs(robot.twin.q()[shoulder()] - robot.last.motor[shoulder()].q); }
  GuardedTwin robot;
};

TEST(RobotGuard, TheWeightOfTheArmsIsFedForward) {
  GuardSetup without = test::twin_guard();
  without.arm_gravity = false;
  const Reaching carried, sagging(without);
  ASSERT_EQ(carried.robot.state(), SafetyState::kRun);
  EXPECT_LT(carried.fed(), -2.0) << "upwards";
  EXPECT_LT(carried.sags(), 0.005);
  EXPECT_EQ(sagging.fed(), 0.0);
  EXPECT_GT(sagging.sags(), 0.04);
  EXPECT_EQ(carried.robot.last.motor[3].tau, 0.0f) << "of a leg nothing is";
  EXPECT_EQ(carried.robot.bad_frames, 0);
}

TEST(RobotGuard, WeightAndGainsTogetherAskForNoMoreThanTheShareOfTheEffort) {
  Reaching blocked;
  GuardedTwin& robot = blocked.robot;
  const auto angle = static_cast<float>(robot.twin.q()[Reaching::shoulder()]);
  robot.spoil = [angle](GuardedTwin::Frames& frames) {
    for (LowStateFrame& frame : frames) {
      frame.motor[Reaching::shoulder()].q = angle;
      frame.motor[Reaching::shoulder()].dq = 0.0f;
      seal(frame);
    }
  };
  robot.message.command.q[Reaching::shoulder()] = -2.0;  // against something above it
  robot.run_for(2.0);
  const MotorCommandFrame& motor = robot.last.motor[Reaching::shoulder()];
  const double most = 0.4 * test::g1()->joints[Reaching::shoulder()].effort;
  EXPECT_NEAR(motor.kp * (motor.q - angle) + motor.tau, -most, 0.05);
  EXPECT_EQ(robot.bad_frames, 0);
}

TEST(RobotGuard, WhatIsNotMeasuredNowIsNotCarried) {
  Reaching reaching;
  reaching.robot.spoil = [](GuardedTwin::Frames& frames) { frames.clear(); };
  reaching.robot.run_for(0.016);
  EXPECT_LT(reaching.fed(), -2.0);
  reaching.robot.run_for(0.008);
  EXPECT_EQ(reaching.fed(), 0.0);
  EXPECT_EQ(reaching.robot.state(), SafetyState::kHold);
}

TEST(RobotGuard, DoesNotWalkWhileItHangsOrLeans) {
  for (const bool leans : {false, true}) {
    GuardedTwin robot;
    const auto trouble = [&](bool there) {
      robot.twin.condition.hangs = there && !leans;
      robot.twin.condition.roll = there && leans ? 0.25 : 0.0;
    };
    trouble(true);
    robot.start();
    EXPECT_EQ(robot.state(), SafetyState::kStand);
    EXPECT_TRUE(robot.guard.status().input.stands);
    EXPECT_EQ(walk_waits_for(robot.guard.setup().rules, robot.guard.status().input),
              leans ? StopCause::kTilt : StopCause::kRope);
    trouble(false);
    robot.run_for(1.0);
    robot.hold_key(RemoteKey::kA);
    robot.run_for(0.1);
    EXPECT_EQ(robot.state(), SafetyState::kRun);
    EXPECT_NEAR(robot.guard.status().input.health.carried, 1.0, 0.1);
    robot.drop_key(RemoteKey::kA);
    robot.wire.foreign = 1;  // held, hung up, and asked to go on
    robot.run_for(0.3);
    robot.wire.foreign = 0;
    trouble(true);
    robot.run_for(2.0);
    robot.hold_key(RemoteKey::kA);
    robot.run_for(0.2);
    EXPECT_EQ(robot.state(), SafetyState::kHold);
  }
}

// HOMIE's or the maker's own controller keeps it on its feet: it has to be there before it is armed.
TEST(RobotGuard, ARobotThatHangsIsNotArmedWhereItsExecutorWalks) {
  GuardSetup setup = test::twin_guard();
  setup.rules.stands_alone = true;
  GuardedTwin robot(setup);
  LowCommandFrame held;
  build_command(setup.stance, 5, held);
  robot.twin.obey(held);  // by the other program
  robot.twin.condition.hangs = true;
  robot.run_for(3.0);
  EXPECT_EQ(robot.state(), SafetyState::kListen);
  EXPECT_EQ(robot.guard.status().safety.missing, "rope");
  robot.twin.condition.hangs = false;
  robot.run_for(3.5);
  EXPECT_EQ(robot.state(), SafetyState::kReady);
}

TEST(RobotGuard, AWriterThatIsLostDampsAndIsMadeAnew) {
  GuardedTwin robot;
  robot.start();
  robot.wire.broken = true;
  EXPECT_NEAR(robot.time_to_leave(SafetyState::kRun), 0.1, 0.01);
  EXPECT_EQ(robot.state(), SafetyState::kDamp);
  EXPECT_EQ(robot.cause(), StopCause::kLostWriter);
  const int before = robot.wire.opened;
  robot.run_for(1.0);
  EXPECT_GT(robot.wire.opened, before + 5);
  EXPECT_LT(robot.wire.opened, before + 15);
  robot.wire.broken = false;
  robot.run_for(10.0);
  EXPECT_EQ(robot.state(), SafetyState::kFault);
  const long written = robot.wire.written;
  robot.run_for(1.0);
  EXPECT_EQ(robot.wire.written, written + 500) << "a fault is damped, tick by tick";
  EXPECT_TRUE(robot.last_damps);
}

TEST(RobotGuard, AWriterThatMissesAFewFramesIsNotLost) {
  GuardedTwin robot;
  robot.start();
  robot.wire.broken = true;
  robot.run_for(0.08);
  robot.wire.broken = false;
  robot.run_for(1.0);
  EXPECT_EQ(robot.state(), SafetyState::kRun);
}

TEST(RunOrDamp, WhatThrowsWhileTheRobotIsCommandedIsFollowedByDamping) {
  const auto fail = [] { throw std::runtime_error("the disk is full"); };
  for (const bool armed : {false, true}) {
    GuardedTwin robot;
    if (armed) robot.start();
    bool damped = false;
    const std::string thrown = test::thrown_message<std::runtime_error>([&] {
      run_or_damp(robot.guard, fail, [&](const std::exception&) {
        robot.run_for(1.0);
        damped = robot.state() == SafetyState::kDamp && robot.last_damps;
      });
    });
    EXPECT_EQ(thrown, "the disk is full");
    EXPECT_EQ(damped, armed);
  }
}

TEST(RobotGuard, AnArmThatIsPushedHardOpensBoth) {
  GuardedTwin robot;
  robot.start();
  EXPECT_FALSE(robot.guard.limiter_input().release);
  robot.spoil = [](GuardedTwin::Frames& frames) {
    for (LowStateFrame& frame : frames) {
      const int joint = test::g1()->roles.arms[0][0];
      frame.motor[joint].tau_est = static_cast<float>(0.9 * test::g1()->joints[joint].effort);
      seal(frame);
    }
  };
  robot.run_for(0.1);
  EXPECT_EQ(robot.state(), SafetyState::kRun);
  EXPECT_TRUE(robot.guard.limiter_input().release);
  robot.run_for(3.0);
  EXPECT_LT(robot.velocity.last.forward, 0.0) << "it steps back";
  robot.drop_key(RemoteKey::kR1);
  robot.run_for(1.0);
  EXPECT_EQ(robot.state(), SafetyState::kHold);
  EXPECT_TRUE(robot.guard.limiter_input().release) << "the arms stay open";
  EXPECT_EQ(robot.velocity.last.forward, 0.0) << "but nothing walks without the dead-man switch";
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
  EXPECT_SENTENCE(refusal([](GuardSetup& s) { s.limiter.robot = nullptr; }));
  EXPECT_SENTENCE(refusal([](GuardSetup& s) { s.limiter.robot = load_shared_robot("g1_12dof"); }));
  EXPECT_SENTENCE(refusal([](GuardSetup& s) { s.stance.kp.resize(2); }));
  EXPECT_SENTENCE(refusal([](GuardSetup& s) { s.gain_ramp = -1.0; }));
}

}  // namespace
}  // namespace duet
