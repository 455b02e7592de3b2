// Faults in every field, of every kind, and for as long as they last: the rest of the matrix T5, T7 and T8 of
// docs/hardware.md, "What proves what". On a simulated clock.
#include <gtest/gtest.h>

#include <limits>
#include <utility>

#include "tests/hardware/guarded_twin.h"

namespace duet {
namespace {

using test::GuardedTwin;
using Frames = GuardedTwin::Frames;
constexpr double kTickOfSweep = GuardedTwin::kDt;
constexpr double kMostStepOfSweep = 0.5 * kTickOfSweep + 1e-6;  // [rad]

void expect_only_inside(const GuardedTwin& robot, const std::string& name) {
  EXPECT_EQ(robot.bad_frames, 0) << name;
  EXPECT_LE(robot.largest_step, kMostStepOfSweep) << name;
  EXPECT_EQ(robot.twin.refused_frames(), 0) << name;
}

// Every number of a state that the guard reads.
std::vector<std::pair<std::string, std::function<float&(LowStateFrame&)>>> fields_of_state() {
  std::vector<std::pair<std::string, std::function<float&(LowStateFrame&)>>> fields;
  for (int j = 0; j < kG1Motors; ++j) {
    const std::string motor = "motor " + std::to_string(j);
    fields.emplace_back(motor + " q", [j](LowStateFrame& f) -> float& { return f.motor[j].q; });
    fields.emplace_back(motor + " dq", [j](LowStateFrame& f) -> float& { return f.motor[j].dq; });
    fields.emplace_back(motor + " tau", [j](LowStateFrame& f) -> float& { return f.motor[j].tau_est; });
  }
  for (int k = 0; k < 4; ++k)
    fields.emplace_back("quaternion", [k](LowStateFrame& f) -> float& { return f.imu.quaternion[k]; });
  for (int k = 0; k < 3; ++k)
    fields.emplace_back("gyroscope", [k](LowStateFrame& f) -> float& { return f.imu.gyroscope[k]; });
  return fields;
}

// One state in a tenth of a second is bad: less than what holds.
TEST(FaultSweep, ANumberThatIsNotFiniteInAnyFieldIsCountedAndNotUsed) {
  for (const float value : {std::numeric_limits<float>::quiet_NaN(), std::numeric_limits<float>::infinity(),
                            -std::numeric_limits<float>::infinity()}) {
    GuardedTwin robot;
    robot.start();
    long bad = 0;
    for (const auto& [name, field] : fields_of_state()) {
      bool once = true;
      robot.spoil = [&, field = field](Frames& frames) {
        if (!std::exchange(once, false)) return;
        field(frames.front()) = value;
        seal(frames.front());
      };
      robot.run_for(0.1);
      EXPECT_EQ(robot.guard.status().number_faults, ++bad) << name << " " << value;
      ASSERT_EQ(robot.state(), SafetyState::kRun) << name << " " << stop_cause_name(robot.cause());
    }
    expect_only_inside(robot, "not finite");
  }
}

TEST(FaultSweep, TheSmallestNumbersAreNumbers) {
  GuardedTwin robot;
  robot.start();
  for (const auto& [name, field] : fields_of_state()) {
    if (name == "quaternion" || name.ends_with(" q")) continue;  // an angle that jumps to 0 holds
    bool once = true;
    robot.spoil = [&, field = field](Frames& frames) {
      if (!std::exchange(once, false)) return;
      field(frames.front()) = 1e-42f;
      seal(frames.front());
    };
    robot.run_for(0.02);
    ASSERT_EQ(robot.state(), SafetyState::kRun) << name;
  }
  EXPECT_EQ(robot.guard.status().number_faults, 0);
  expect_only_inside(robot, "denormal");
}

// An absurd speed holds at once; an absurd angle or torque changes no command by more than its limits.
TEST(FaultSweep, AHugeNumberInAnyFieldStaysInsideTheLimits) {
  const auto fields = fields_of_state();
  for (std::size_t k = 0; k < fields.size(); k += 4) {  // a quarter of them: each takes a run of its own
    for (const float value : {1e30f, -1e30f}) {
      const auto& [name, field] = fields[k];
      GuardedTwin robot;
      robot.start();
      robot.spoil = [value, field = field](Frames& frames) {
        field(frames.front()) = value;
        seal(frames.front());
      };
      robot.run_for(0.1);
      if (name.ends_with(" dq") || name == "gyroscope") {
        EXPECT_EQ(robot.state(), SafetyState::kHold) << name;
      }
      expect_only_inside(robot, name);
    }
  }
}

struct LastingFault {
  const char* name;
  std::function<void(Frames&)> spoil;
};

// Faults that the counts of bad states are for: each tick or each other brings one.
TEST(FaultSweep, OlderAndSwappedStatesThatLastHold) {
  const std::vector<LastingFault> faults = {{"each with the one before it again, behind it",
                                             [last = Frames()](Frames& f) mutable {
                                               const Frames now = f;
                                               f.insert(f.end(), last.begin(), last.end());
                                               last = now;
                                             }},
                                            {"in pairs, the newer first", [kept = Frames()](Frames& f) mutable {
                                               if (kept.empty()) {
                                                 std::swap(kept, f);
                                                 return;
                                               }
                                               f.push_back(kept.front());
                                               kept.clear();
                                             }}};
  for (const LastingFault& fault : faults) {
    GuardedTwin robot;
    robot.start();
    robot.spoil = fault.spoil;
    EXPECT_LE(robot.time_to_leave(SafetyState::kRun), 0.05 + 2.5 * kTickOfSweep) << fault.name;
    EXPECT_EQ(robot.state(), SafetyState::kHold) << fault.name;
    EXPECT_EQ(robot.cause(), StopCause::kBadStates) << fault.name;
    robot.run_for(1.0);
    expect_only_inside(robot, fault.name);
  }
}

// As unitree_mujoco sends them: a thousand times a second, of a robot that counts 500.
TEST(FaultSweep, TheSameStateAgainIsNoFaultAndNoNews) {
  GuardedTwin robot;
  robot.start();
  robot.spoil = [last = Frames()](Frames& f) mutable {
    const Frames now = f;
    f.push_back(f.front());
    f.insert(f.begin(), last.begin(), last.end());
    last = now;
  };
  robot.run_for(1.0);
  EXPECT_EQ(robot.state(), SafetyState::kRun);
  EXPECT_EQ(robot.guard.status().tick_faults, 0);
  robot.spoil = [last = Frames()](Frames& f) mutable {  // one and the same for ever
    if (last.empty()) last = f;
    f = last;
  };
  EXPECT_LE(robot.time_to_leave(SafetyState::kRun), 0.020 + 2.5 * kTickOfSweep);
  EXPECT_EQ(robot.cause(), StopCause::kStateAge);
}

// The operator still has the key down with which it was made to run.
TEST(FaultSweep, AGapOfStatesUnderAKeyThatIsHeldHolds) {
  GuardedTwin robot;
  robot.start();
  robot.hold_key(RemoteKey::kA);
  robot.run_for(0.1);
  robot.spoil = [left = 30](Frames& f) mutable {
    if (left-- > 0) f.clear();
  };
  robot.run_for(2.0);
  EXPECT_EQ(robot.state(), SafetyState::kHold);
  EXPECT_EQ(robot.cause(), StopCause::kStateAge);
  robot.drop_key(RemoteKey::kA);
  robot.run_for(0.1);
  robot.hold_key(RemoteKey::kA);
  robot.run_for(0.1);
  EXPECT_EQ(robot.state(), SafetyState::kRun);
}

TEST(FaultSweep, EveryStateDroppedForAWhileDampsWithinATenthOfASecond) {
  GuardedTwin robot;
  robot.start();
  robot.spoil = [](Frames& f) { f.clear(); };
  const double begin = robot.now;
  robot.time_to_leave(SafetyState::kRun);
  robot.time_to_leave(SafetyState::kHold);
  EXPECT_EQ(robot.state(), SafetyState::kDamp);
  EXPECT_LE(robot.now - begin, 0.1 + 2.5 * kTickOfSweep);
}

TEST(FaultSweep, TheStopKeysDampAtOnce) {
  for (const std::vector<RemoteKey>& keys :
       {std::vector{RemoteKey::kSelect}, std::vector{RemoteKey::kL2, RemoteKey::kB}}) {
    GuardedTwin robot;
    robot.start();
    for (const RemoteKey key : keys) robot.hold_key(key);
    EXPECT_LE(robot.time_to_leave(SafetyState::kRun), 1.5 * kTickOfSweep);
    EXPECT_EQ(robot.state(), SafetyState::kDamp);
    EXPECT_EQ(robot.cause(), StopCause::kStopKey);
    expect_only_inside(robot, "stop key");
  }
}

GuardSetup with_battery() {
  GuardSetup setup = test::twin_guard();
  setup.has_battery = true;
  return setup;
}

TEST(FaultSweep, ALowOrUnknownChargeHolds) {
  GuardedTwin low(with_battery());
  low.guard.receive(BatteryReading{50.0}, low.now);
  low.start();
  ASSERT_EQ(low.state(), SafetyState::kRun) << stop_cause_name(low.cause());
  low.guard.receive(BatteryReading{19.0}, low.now);
  low.tick();
  EXPECT_EQ(low.state(), SafetyState::kHold);
  EXPECT_EQ(low.cause(), StopCause::kCharge);
  GuardedTwin silent(with_battery());
  silent.guard.receive(BatteryReading{50.0}, silent.now);
  silent.start();
  silent.time_to_leave(SafetyState::kRun, 6.0);
  EXPECT_EQ(silent.cause(), StopCause::kCharge);  // five seconds without a word of it
  GuardedTwin never(with_battery());
  never.start();
  EXPECT_EQ(never.state(), SafetyState::kListen);
}

// A planner that sends nothing but rubbish is a planner that has died.
TEST(FaultSweep, APlannerWhoseCommandsAreAllRefusedHolds) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const std::vector<std::pair<const char*, std::function<void(MotionCommand&)>>> bad = {
      {"nan velocity", [=](MotionCommand& c) { c.root.forward = nan; }},
      {"nan target", [=](MotionCommand& c) { c.q[20] = nan; }},
      {"stamp that stands", [](MotionCommand& c) { c.stamp = 1.0; }},
      {"size", [](MotionCommand& c) { c.q.resize(3); }}};
  for (const auto& [name, spoil] : bad) {
    GuardedTwin robot;
    robot.start();
    robot.message.command.root.forward = 0.2;
    robot.run_for(1.0);
    robot.plans = false;
    PlannerMessage message = robot.message;
    const double begin = robot.now;
    while (robot.state() == SafetyState::kRun && robot.now - begin < 2.0) {
      ++message.sequence;
      message.command = robot.message.command;
      message.command.stamp = robot.now;
      spoil(message.command);
      robot.guard.receive(message, robot.now);
      robot.tick();
    }
    EXPECT_NEAR(robot.now - begin, 0.6, 0.03) << name;
    EXPECT_EQ(robot.cause(), StopCause::kPlannerAge) << name;
    expect_only_inside(robot, name);
  }
}

// T7: a stamp far in the future is the planner's own: it cannot keep it alive beyond its next, honest one.
TEST(FaultSweep, APlannerWithOneStampInTheFutureIsLateFromThenOn) {
  GuardedTwin robot;
  robot.start();
  ++robot.message.sequence;
  robot.message.command.stamp = 1e9;
  robot.guard.receive(robot.message, robot.now);
  robot.time_to_leave(SafetyState::kRun);
  EXPECT_EQ(robot.state(), SafetyState::kHold);
  EXPECT_EQ(robot.cause(), StopCause::kPlannerAge);
}

TEST(FaultSweep, AForeignWriterWhileItRunsHolds) {
  GuardedTwin robot;
  robot.start();
  robot.wire.foreign = 1;
  EXPECT_LE(robot.time_to_leave(SafetyState::kRun), 0.1 + 2.5 * kTickOfSweep);
  EXPECT_EQ(robot.state(), SafetyState::kHold);
  EXPECT_EQ(robot.cause(), StopCause::kForeignWriter);
  robot.run_for(1.0);
  expect_only_inside(robot, "foreign writer");
}

}  // namespace
}  // namespace duet
