#include "duet/hardware/safety/safety_machine.h"

#include <gtest/gtest.h>

#include <set>
#include <string>
#include <utility>

#include "duet/core/numbers.h"
#include "tests/hardware/simulated_safety.h"

namespace duet {
namespace {

using test::kTick;
using test::SimulatedSafety;
using Spoil = std::function<void(SafetyInput&)>;
constexpr double kTicks = 2.5 * kTick;  // what may pass until a tick notices [s]

SimulatedSafety in_state(SafetyState state) {
  SimulatedSafety robot;
  robot.go_to(state);
  EXPECT_EQ(robot.memory.state, state) << safety_state_name(state);
  return robot;
}

TEST(SafetyMachine, IsOfflineUntilARobotIsHeardOf) {
  SimulatedSafety robot;
  robot.run_for(1.0, [](SafetyInput& in) { in.state_at = kNever; });
  EXPECT_EQ(robot.memory.state, SafetyState::kOffline);
  robot.tick();
  EXPECT_EQ(robot.memory.state, SafetyState::kListen);
}

TEST(SafetyMachine, IsReadyAfterTwoSecondsOfEverythingWell) {
  SimulatedSafety robot = in_state(SafetyState::kListen);
  robot.run_for(1.9);
  EXPECT_EQ(robot.memory.state, SafetyState::kListen);
  robot.run_for(0.2);
  EXPECT_EQ(robot.memory.state, SafetyState::kReady);
}

TEST(SafetyMachine, ABadMomentBeginsTheTwoSecondsAnew) {
  SimulatedSafety robot = in_state(SafetyState::kListen);
  robot.run_for(1.5);
  robot.tick([](SafetyInput& in) { in.health.tilt = 0.6; });
  robot.input.health.tilt = 0.0;
  robot.run_for(1.9);
  EXPECT_EQ(robot.memory.state, SafetyState::kListen);
  EXPECT_EQ(robot.memory.missing, "tilt") << "what was last missing stays, for whoever asks why it waits";
  robot.run_for(0.2);
  EXPECT_EQ(robot.memory.state, SafetyState::kReady);
}

TEST(SafetyMachine, ReadyEndsWithWhatMadeItReady) {
  SimulatedSafety robot = in_state(SafetyState::kReady);
  robot.tick([](SafetyInput& in) { in.health.joints.excess = 0.03; });
  EXPECT_EQ(robot.memory.state, SafetyState::kListen);
  EXPECT_EQ(robot.memory.missing, "joint_range");
  SimulatedSafety late = in_state(SafetyState::kReady);
  late.tick([](SafetyInput& in) { in.state_delay = 0.03; });
  EXPECT_EQ(late.memory.state, SafetyState::kListen);
  EXPECT_EQ(late.memory.missing, "state_delay");
}

TEST(SafetyMachine, ArmsOnlyFromReady) {
  SimulatedSafety robot = in_state(SafetyState::kListen);
  robot.run_for(1.0, [](SafetyInput& in) { in.arm = true; });
  EXPECT_EQ(robot.memory.state, SafetyState::kListen);
  EXPECT_EQ(in_state(SafetyState::kArmed).memory.state, SafetyState::kArmed);
}

TEST(SafetyMachine, AnArmingLapsesAfterAMinute) {
  SimulatedSafety robot = in_state(SafetyState::kArmed);
  robot.run_for(59.9);
  EXPECT_EQ(robot.memory.state, SafetyState::kArmed);
  robot.run_for(0.2);
  EXPECT_EQ(robot.memory.state, SafetyState::kDamp);
  EXPECT_EQ(robot.memory.cause, StopCause::kLapsed);
  robot.run_for(5.1);
  EXPECT_EQ(robot.memory.state, SafetyState::kListen);
}

TEST(SafetyMachine, RunsOnlyWhenItStands) {
  SimulatedSafety robot = in_state(SafetyState::kStand);
  robot.input.stands = false;
  robot.tick([](SafetyInput& in) { in.run = true; });
  EXPECT_EQ(robot.memory.state, SafetyState::kStand);
  robot.input.stands = true;
  robot.tick();
  EXPECT_EQ(robot.memory.state, SafetyState::kRun);
}

TEST(SafetyMachine, DoesNotRunWithoutDeadManPlannerPersonOrOdometry) {
  for (double SafetyInput::*at :
       {&SafetyInput::dead_man_at, &SafetyInput::planner_at, &SafetyInput::person_at, &SafetyInput::odometry_at}) {
    SimulatedSafety robot = in_state(SafetyState::kStand);
    robot.run_for(0.1, [at](SafetyInput& in) {
      in.run = true;
      in.*at = kNever;
    });
    EXPECT_EQ(robot.memory.state, SafetyState::kStand);
  }
}

struct Fault {
  const char* name;
  Spoil spoil;
  SafetyState reached;  // from running
  double within;        // [s]
};

Spoil cut(double SafetyInput::*at) {
  return [at, last = 0.0](SafetyInput& in) mutable {
    if (last == 0.0) last = in.now - kTick;
    in.*at = last;
  };
}

std::vector<Fault> faults() {
  return {{"no states", cut(&SafetyInput::state_at), SafetyState::kHold, 0.020},
          {"no planner", cut(&SafetyInput::planner_at), SafetyState::kHold, 0.6},
          {"no person", cut(&SafetyInput::person_at), SafetyState::kHold, 0.25},
          {"no odometry", cut(&SafetyInput::odometry_at), SafetyState::kHold, 0.15},
          {"no remote", cut(&SafetyInput::remote_at), SafetyState::kHold, 0.2},
          {"dead man", cut(&SafetyInput::dead_man_at), SafetyState::kHold, 0.2},
          {"bad states", [](SafetyInput& in) { in.bad_states = 1; }, SafetyState::kHold, 0.006},
          {"many bad states", [](SafetyInput& in) { in.bad_states = 10; }, SafetyState::kHold, 0.0},
          {"writer", [](SafetyInput& in) { in.written_at = in.now - 0.11; }, SafetyState::kDamp, 0.0},
          {"odometry jump", [](SafetyInput& in) { in.odometry_step = 0.2; }, SafetyState::kHold, 0.0},
          {"tilt", [](SafetyInput& in) { in.health.tilt = 0.7; }, SafetyState::kHold, 0.0},
          {"fall", [](SafetyInput& in) { in.health.tilt = 1.2; }, SafetyState::kDamp, 0.0},
          {"joint speed", [](SafetyInput& in) { in.health.joint_speed_share = 1.2; }, SafetyState::kHold, 0.0},
          {"gyro", [](SafetyInput& in) { in.health.gyro = 7.0; }, SafetyState::kHold, 0.0},
          {"hot winding", [](SafetyInput& in) { in.health.winding = 130.0; }, SafetyState::kHold, 0.0},
          {"hot casing", [](SafetyInput& in) { in.health.casing = 90.0; }, SafetyState::kHold, 0.0},
          {"charge", [](SafetyInput& in) { in.health.charge = 10.0; }, SafetyState::kHold, 0.0},
          {"motor", [](SafetyInput& in) { in.health.motor_error = true; }, SafetyState::kDamp, 0.0},
          {"mode", [](SafetyInput& in) { in.health.mode_is_expected = false; }, SafetyState::kHold, 0.0},
          {"foreign writer", [](SafetyInput& in) { in.foreign_writer = true; }, SafetyState::kHold, 0.0},
          {"stop key", [](SafetyInput& in) { in.stop_key = true; }, SafetyState::kDamp, 0.0},
          {"paused",
           [](SafetyInput& in) {
             in.now += 1.0;
             in.state_at = in.now;
           },
           SafetyState::kHold, 1.0},
          {"short pause", [](SafetyInput& in) { in.now += 0.05; }, SafetyState::kHold, 0.05},
          {"clock back", [](SafetyInput& in) { in.now -= 1.0; }, SafetyState::kHold, 0.0}};
}

TEST(SafetyMachine, EachFaultReachesItsStateInItsTime) {
  for (const Fault& fault : faults()) {
    SimulatedSafety robot = in_state(SafetyState::kRun);
    const double taken = robot.time_to_leave(SafetyState::kRun, fault.spoil);
    EXPECT_EQ(robot.memory.state, fault.reached) << fault.name;
    EXPECT_LE(taken, fault.within + kTicks) << fault.name;
    EXPECT_EQ(robot.order().share, 0.0) << fault.name;
  }
}

// A pause: the first tick after it stops, whatever comes next, and the robot stands.
TEST(SafetyMachine, AfterAPauseNoTickMoves) {
  SimulatedSafety robot = in_state(SafetyState::kRun);
  robot.input.now += 1.0;
  robot.tick();
  EXPECT_EQ(robot.memory.state, SafetyState::kHold);
  EXPECT_EQ(robot.memory.cause, StopCause::kLoopLate);
  robot.run_for(1.0);
  EXPECT_EQ(robot.order().share, 0.0);
}

TEST(SafetyMachine, ALatePlannerMayComeBackWithinTwoSeconds) {
  SimulatedSafety robot = in_state(SafetyState::kRun);
  robot.run_for(2.5, cut(&SafetyInput::planner_at));
  EXPECT_EQ(robot.memory.state, SafetyState::kHold);
  robot.tick();
  EXPECT_EQ(robot.memory.state, SafetyState::kRun);
}

TEST(SafetyMachine, APlannerThatStaysAwayIsHeldForWithoutEndAndDoesNotComeBackByItself) {
  SimulatedSafety robot = in_state(SafetyState::kRun);
  robot.run_for(2.7, cut(&SafetyInput::planner_at));
  robot.tick();
  EXPECT_EQ(robot.memory.state, SafetyState::kHold) << "2 s of holding are over";
  robot.run_for(100.0, cut(&SafetyInput::planner_at));
  EXPECT_EQ(robot.memory.state, SafetyState::kHold);
  EXPECT_EQ(robot.memory.cause, StopCause::kPlannerAge);
}

// The five causes that damp; a biped that is damped falls.
TEST(SafetyMachine, OnlyFiveCausesDamp) {
  std::set<std::string> damp;
  for (const Fault& fault : faults()) {
    for (const SafetyState from : {SafetyState::kRun, SafetyState::kHold, SafetyState::kStand}) {
      SimulatedSafety robot = in_state(from == SafetyState::kHold ? SafetyState::kRun : from);
      if (from == SafetyState::kHold) robot.tick([](SafetyInput& in) { in.foreign_writer = true; });
      robot.input.foreign_writer = false;
      for (int k = 0; k < 1000; ++k) robot.tick(fault.spoil);
      if (robot.memory.state < SafetyState::kDamp) continue;
      damp.insert(std::string(stop_cause_name(robot.memory.cause)));
    }
  }
  EXPECT_EQ(damp, (std::set<std::string>{"state_age", "tilt", "motor_error", "stop_key", "lost_writer"}));
}

TEST(SafetyMachine, AHoldEndsWhenAllIsWellAndTheOperatorAsksAnew) {
  SimulatedSafety robot = in_state(SafetyState::kRun);
  robot.input.run = true;
  robot.tick([](SafetyInput& in) { in.foreign_writer = true; });
  robot.run_for(1.0);
  EXPECT_EQ(robot.memory.state, SafetyState::kHold) << "another writes";
  robot.input.foreign_writer = false;
  robot.run_for(30.0);
  EXPECT_EQ(robot.memory.state, SafetyState::kHold) << "the key was held all the time";
  robot.input.run = false;
  robot.tick();
  EXPECT_EQ(robot.memory.state, SafetyState::kHold);
  robot.input.run = true;
  robot.tick([](SafetyInput& in) { in.dead_man_at = in.now - 1.0; });
  EXPECT_EQ(robot.memory.state, SafetyState::kHold) << "nobody holds the dead-man switch";
  robot.tick();
  EXPECT_EQ(robot.memory.state, SafetyState::kRun);
}

TEST(SafetyMachine, AHoldEndsOnlyUprightAndOnItsFeet) {
  for (const bool leans : {true, false}) {
    SimulatedSafety robot = in_state(SafetyState::kRun);
    const RobotHealth well = robot.input.health;
    robot.input.foreign_writer = true;
    robot.tick();
    robot.input.foreign_writer = false;
    (leans ? robot.input.health.tilt : robot.input.health.carried) = leans ? 0.3 : 0.2;
    robot.tick();
    robot.input.run = true;
    robot.run_for(1.0);
    EXPECT_EQ(robot.memory.state, SafetyState::kHold) << leans;
    robot.input.health = well;
    robot.tick();
    EXPECT_EQ(robot.memory.state, SafetyState::kRun) << leans;
  }
}

// A gap of states hides the key: it is not thereby let go.
TEST(SafetyMachine, AKeyThatWasNotHeardWasNotLetGo) {
  for (const bool stands : {true, false}) {
    SimulatedSafety robot = in_state(stands ? SafetyState::kRun : SafetyState::kStand);
    robot.input.stands = stands;
    bool& key = stands ? robot.input.run : robot.input.stand;
    key = true;
    robot.input.foreign_writer = true;
    robot.tick();
    robot.input.foreign_writer = key = false;
    robot.tick([](SafetyInput& in) { in.remote_at = in.now - kTick; });
    key = true;
    robot.run_for(1.0);
    EXPECT_EQ(robot.memory.state, SafetyState::kHold) << "held all the time, " << stands;
    key = false;
    robot.tick();
    key = true;
    robot.tick();
    EXPECT_EQ(robot.memory.state, stands ? SafetyState::kRun : SafetyState::kStand);
  }
}

TEST(SafetyMachine, APlannersHoldWithAnotherFaultDoesNotEndByItself) {
  SimulatedSafety robot = in_state(SafetyState::kRun);
  robot.run_for(0.7, cut(&SafetyInput::planner_at));
  robot.tick([](SafetyInput& in) {
    in.planner_at = in.now - 1.0;
    in.health.tilt = 0.6;
  });
  robot.input.health.tilt = 0.0;
  robot.run_for(1.0);
  EXPECT_EQ(robot.memory.state, SafetyState::kHold);
  EXPECT_EQ(robot.memory.cause, StopCause::kTilt);
}

TEST(SafetyMachine, AHoldBeforeItStoodEndsInStandingUp) {
  SimulatedSafety robot = in_state(SafetyState::kStand);
  robot.input.stands = false;
  robot.input.foreign_writer = true;
  robot.tick();
  EXPECT_EQ(robot.memory.state, SafetyState::kHold);
  robot.input.stand = robot.input.run = true;
  robot.tick();
  EXPECT_EQ(robot.memory.state, SafetyState::kHold) << "another writes";
  robot.input.foreign_writer = robot.input.stand = false;
  robot.run_for(1.0);
  robot.input.run = false;
  robot.tick();
  robot.input.run = true;
  robot.tick();
  EXPECT_EQ(robot.memory.state, SafetyState::kHold) << "it does not stand";
  robot.input.stand = true;
  robot.tick([](SafetyInput& in) { in.planner_at = in.dead_man_at = kNever; });
  EXPECT_EQ(robot.memory.state, SafetyState::kStand);
}

TEST(SafetyMachine, StandingUpNeedsTheDeadManSwitchAndAKnownPerson) {
  SimulatedSafety robot = in_state(SafetyState::kStand);
  EXPECT_EQ(robot.order().share, 1.0);
  for (const auto& [at, cause] : {std::pair(&SafetyInput::dead_man_at, StopCause::kDeadMan),
                                  std::pair(&SafetyInput::person_at, StopCause::kPersonAge)}) {
    robot.tick([at = at](SafetyInput& in) { in.*at = in.now - 0.3; });
    EXPECT_EQ(robot.order().share, 0.0);
    EXPECT_EQ(stand_waits_for(robot.rules, robot.input), cause);
    EXPECT_EQ(robot.memory.state, SafetyState::kStand);
    EXPECT_TRUE(robot.order().stands);
  }
  robot.rules.person_present = false;
  EXPECT_EQ(stand_waits_for(robot.rules, robot.input), StopCause::kNone);
}

TEST(SafetyMachine, ChargeAndHeatKeepItFromBeingArmedBeforeTheyHold) {
  for (const auto& spoil : {Spoil([](SafetyInput& in) { in.health.charge = 29.0; }),
                            Spoil([](SafetyInput& in) { in.health.casing = 76.0; }),
                            Spoil([](SafetyInput& in) { in.health.winding = 101.0; })}) {
    SimulatedSafety robot = in_state(SafetyState::kListen);
    robot.run_for(3.0, spoil);
    EXPECT_EQ(robot.memory.state, SafetyState::kListen);
    EXPECT_TRUE(robot.memory.missing == "charge" || robot.memory.missing == "temperature") << robot.memory.missing;
    robot = in_state(SafetyState::kRun);
    robot.run_for(3.0, spoil);
    EXPECT_EQ(robot.memory.state, SafetyState::kRun);
    EXPECT_EQ(assess(robot.rules, robot.input, {}, robot.memory.last_now, true).level, StopLevel::kWarn);
  }
}

TEST(SafetyMachine, BeginsToWalkOnlyUprightAndOnItsFeet) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  for (const auto& spoil :
       {Spoil([](SafetyInput& in) { in.health.tilt = 0.21; }), Spoil([](SafetyInput& in) { in.health.carried = 0.49; }),
        Spoil([nan](SafetyInput& in) { in.health.carried = nan; })}) {
    SimulatedSafety robot = in_state(SafetyState::kStand);
    robot.input.run = true;
    robot.run_for(1.0, spoil);
    EXPECT_EQ(robot.memory.state, SafetyState::kStand);
    robot = in_state(SafetyState::kRun);
    robot.run_for(1.0, spoil);
    EXPECT_EQ(robot.memory.state, SafetyState::kRun) << "one that walks is not held for it";
    robot = in_state(SafetyState::kListen);
    robot.run_for(3.0, spoil);
    EXPECT_EQ(robot.memory.state, SafetyState::kReady) << "one that is stood up by us may hang";
    robot = in_state(SafetyState::kListen);
    robot.rules.stands_alone = true;
    robot.run_for(3.0, spoil);
    EXPECT_EQ(robot.memory.state, SafetyState::kListen);
    EXPECT_TRUE(robot.memory.missing == "rope" || robot.memory.missing == "tilt") << robot.memory.missing;
    EXPECT_FALSE(stop_cause_text(robot.memory.missing).empty());
  }
  EXPECT_EQ(stop_cause_text("none of them"), "");
}

TEST(SafetyMachine, DampingLastsFiveSecondsAndThenLatches) {
  SimulatedSafety robot = in_state(SafetyState::kRun);
  robot.tick([](SafetyInput& in) { in.health.tilt = 1.2; });
  robot.input.health.tilt = 0.0;
  robot.run_for(4.9);
  EXPECT_EQ(robot.memory.state, SafetyState::kDamp);
  robot.run_for(0.2);
  EXPECT_EQ(robot.memory.state, SafetyState::kFault);
  robot.input.arm = robot.input.stand = robot.input.run = true;
  robot.run_for(100.0);
  EXPECT_EQ(robot.memory.state, SafetyState::kFault);
  EXPECT_TRUE(robot.order().damps);
}

TEST(SafetyMachine, AfterTheStopKeyItMayBeArmedAnew) {
  SimulatedSafety robot = in_state(SafetyState::kRun);
  robot.tick([](SafetyInput& in) { in.stop_key = true; });
  robot.input.stop_key = false;
  robot.run_for(5.1);
  EXPECT_EQ(robot.memory.state, SafetyState::kListen);
  EXPECT_TRUE(robot.order().writes && robot.order().damps) << "a robot that was armed is never without commands";
  robot.run_for(2.1);
  EXPECT_EQ(robot.memory.state, SafetyState::kReady);
  EXPECT_TRUE(robot.order().writes && robot.order().damps);
}

TEST(SafetyMachine, AFaultWhileTheOperatorsStopDampsLatches) {
  SimulatedSafety robot = in_state(SafetyState::kRun);
  robot.tick([](SafetyInput& in) { in.stop_key = true; });
  robot.input.stop_key = false;
  robot.tick([](SafetyInput& in) { in.health.motor_error = true; });
  robot.run_for(5.1);
  EXPECT_EQ(robot.memory.state, SafetyState::kFault);
}

// Every state meets every fault: none starts to move by it, and only listening and damping stay as they are.
TEST(SafetyMachine, EveryStateMeetsEveryFault) {
  for (const SafetyState state :
       {SafetyState::kListen, SafetyState::kReady, SafetyState::kArmed, SafetyState::kStand}) {
    for (const Fault& fault : faults()) {
      SimulatedSafety robot = in_state(state);
      for (int k = 0; k < 1000; ++k) robot.tick(fault.spoil);
      EXPECT_NE(robot.memory.state, SafetyState::kRun) << safety_state_name(state) << ", " << fault.name;
      EXPECT_TRUE(robot.order().share == 0.0 || robot.memory.state == SafetyState::kStand)
          << safety_state_name(state) << ", " << fault.name;
      if (state <= SafetyState::kReady) {
        EXPECT_FALSE(robot.order().writes) << safety_state_name(state) << ", " << fault.name;
      }
    }
  }
}

TEST(SafetyMachine, WhatEachStateAllows) {
  const auto order = [](SafetyState state) { return in_state(state).order(); };
  for (const SafetyState state : {SafetyState::kListen, SafetyState::kReady}) EXPECT_FALSE(order(state).writes);
  EXPECT_TRUE(order(SafetyState::kArmed).writes && order(SafetyState::kArmed).damps);
  EXPECT_TRUE(order(SafetyState::kStand).writes && order(SafetyState::kStand).stands);
  EXPECT_FALSE(order(SafetyState::kStand).damps);
  EXPECT_EQ(order(SafetyState::kRun).share, 1.0);
}

// Whatever comes in: nothing planned moves outside running, nothing is written before arming, a fault stays one.
TEST(SafetyMachine, RandomEventsBreakNoRule) {
  Random random(19, 4);
  const std::vector<Fault> all = faults();
  for (int episode = 0; episode < 200; ++episode) {
    SimulatedSafety robot;
    bool armed = false;
    for (int k = 0; k < 4000; ++k) {
      const SafetyState before = robot.memory.state;
      robot.input.arm = random.chance(0.01);
      robot.input.stand = random.chance(0.05);
      robot.input.run = random.chance(0.05);
      robot.input.health = {};
      robot.input.odometry_step = 0.0;
      robot.input.foreign_writer = robot.input.stop_key = false;
      const Fault& fault = all[random.below(static_cast<int>(all.size()))];
      robot.tick(random.chance(0.001) ? fault.spoil : Spoil());
      const SafetyOrder order = robot.order();
      armed = armed || (before == SafetyState::kReady && robot.memory.state == SafetyState::kArmed);
      ASSERT_TRUE(order.share == 0.0 || robot.memory.state == SafetyState::kRun || order.stands);
      ASSERT_EQ(order.writes, armed);
      ASSERT_TRUE(!order.writes || order.damps || order.stands || robot.memory.state == SafetyState::kRun ||
                  robot.memory.state == SafetyState::kHold);
      ASSERT_FALSE(order.damps && order.share > 0.0);
      ASSERT_TRUE(before != SafetyState::kFault || robot.memory.state == SafetyState::kFault);
    }
  }
}

}  // namespace
}  // namespace duet
