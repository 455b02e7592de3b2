// Faults on the way between twin and guard, beside those of fault_table_test.cpp: each reaches its state within the
// time of its table, and every frame that was sent is inside its limits.
#include <gtest/gtest.h>

#include <algorithm>
#include <functional>
#include <limits>
#include <optional>
#include <utility>
#include <vector>

#include "duet/core/numbers.h"
#include "tests/hardware/wire_faults.h"

namespace duet {
namespace {

using test::delayed;
using test::dropped;
using test::flipped;
using test::Frames;
using test::GuardedTwin;
using test::in_each;
constexpr double kTick = GuardedTwin::kDt;
constexpr double kMostStep = 0.5 * kTick + 1e-6;  // of a target between two frames [rad]

void expect_inside(const GuardedTwin& robot, const char* name) {
  EXPECT_EQ(robot.bad_frames, 0) << name;
  EXPECT_LE(robot.largest_step, kMostStep) << name;
  EXPECT_EQ(robot.twin.refused_frames(), 0) << name;
}

// Less than what holds: it runs on, and nothing bad leaves.
TEST(FaultMatrix, RunsOnThroughALittle) {
  const std::vector<std::pair<const char*, std::function<void(Frames&)>>> little = {
      {"5 % dropped", dropped(0.05)},
      {"half dropped",
       [k = 0](Frames& f) mutable {
         if (++k % 2 == 0) f.clear();
       }},
      {"one flipped in 30", flipped(30)},
      {"5 ms late", delayed(2)},
      {"reordered once",
       [k = 0, kept = Frames()](Frames& f) mutable {
         if (++k == 20) std::swap(kept, f);
         if (k == 21) f.insert(f.end(), kept.begin(), kept.end());
       }},
      {"duplicated once",
       [k = 0](Frames& f) mutable {
         if (++k == 20) f.push_back(f.front());
       }},
      {"denormal torque", in_each([](LowStateFrame& f) { f.motor[5].tau_est = 1e-42f; })}};
  for (const auto& [name, spoil] : little) {
    GuardedTwin robot;
    robot.start();
    robot.message.command.root.forward = 0.1;
    robot.spoil = spoil;
    robot.run_for(1.5);
    EXPECT_EQ(robot.state(), SafetyState::kRun) << name << ": " << stop_cause_name(robot.cause());
    EXPECT_NEAR(robot.velocity.last.forward, 0.1, 1e-6) << name;
    expect_inside(robot, name);
  }
}

// The robot runs, and one joint reports a speed in so many states, one after the other.
SafetyState after_fast_states(int joint, double speed, int states) {
  GuardedTwin robot;
  robot.start();
  int left = states;
  robot.spoil = [&](GuardedTwin::Frames& frames) {
    for (LowStateFrame& frame : frames) {
      if (left-- > 0) frame.motor[joint].dq = static_cast<float>(speed);
      seal(frame);
    }
  };
  robot.run_for(0.1);
  EXPECT_EQ(robot.state() == SafetyState::kHold, robot.cause() == StopCause::kJointSpeed) << joint;
  return robot.state();
}

TEST(FaultMatrix, ASpeedCountsAfterThreeStatesByTheJointsOwnLimit) {
  const std::vector<int>& leg = test::g1()->roles.legs[0];
  const int shoulder = test::g1()->roles.arms[1][0], knee = leg[3], ankle = leg[4];
  for (const auto& [joint, most] : {std::pair{shoulder, 10.0}, {knee, 15.0}, {ankle, 18.5}, {leg[0], 24.0}})
    for (const double sign : {1.0, -1.0}) {
      EXPECT_EQ(after_fast_states(joint, sign * 3.0 * most, 2), SafetyState::kRun) << joint;
      EXPECT_EQ(after_fast_states(joint, sign * (most - 0.1), 20), SafetyState::kRun) << joint;
      EXPECT_EQ(after_fast_states(joint, sign * (most + 0.1), 3), SafetyState::kHold) << joint;
    }
}

// The states of both arms change places, joint by joint.
void exchange_arms(LowStateFrame& frame, bool reversed) {
  const auto& arms = test::g1()->roles.arms;
  const LowStateFrame before = frame;
  for (std::size_t k = 0; k < arms[0].size(); ++k)
    for (std::size_t side = 0; side < 2; ++side)
      frame.motor[arms[side][k]] = before.motor[reversed ? arms[side][arms[side].size() - 1 - k] : arms[1 - side][k]];
}

TwinOptions noisy_joints() {
  TwinOptions options;
  options.joint_noise = 0.002;
  options.joint_speed_noise = 0.1;
  options.gyro_noise = 0.05;
  return options;
}

struct Implausible {
  const char* name;
  std::function<void(LowStateFrame&)> change;
  StopCause cause;
  double within;  // [s]
};

std::vector<Implausible> implausible_joints() {
  const std::vector<int>& arm = test::g1()->roles.arms[0];
  const int elbow = arm[3], knee = test::g1()->roles.legs[1][3];
  const double beyond = test::g1()->joints[elbow].upper + 0.2;
  return {
      {"an angle of 30,000 rad", [=](LowStateFrame& f) { f.motor[knee].q = 30000.0f; }, StopCause::kJointJump, 0.0},
      {"an elbow 0.2 rad off", [=](LowStateFrame& f) { f.motor[elbow].q += 0.2f; }, StopCause::kJointJump, 0.0},
      {"arms reversed", [](LowStateFrame& f) { exchange_arms(f, true); }, StopCause::kJointJump, 0.0},
      {"arms swapped", [](LowStateFrame& f) { exchange_arms(f, false); }, StopCause::kJointJump, 0.0},
      {"joints frozen, fresh ticks",
       [kept = std::optional<LowStateFrame>()](LowStateFrame& f) mutable {
         if (!kept) kept = f;
         std::copy_n(kept->motor, kG1Motors, f.motor);
       },
       StopCause::kJointFrozen, 0.05},
      {"an elbow without a speed", [=](LowStateFrame& f) { f.motor[elbow].dq = 0.0f; }, StopCause::kJointMismatch, 1.5},
      {"speeds of the other elbow",
       [=](LowStateFrame& f) { std::swap(f.motor[elbow].dq, f.motor[test::g1()->roles.arms[1][3]].dq); },
       StopCause::kJointMismatch, 1.5},
      {"an elbow whose zero drifts",
       [=, off = 0.0](LowStateFrame& f) mutable {
         off = std::min(off + 0.002, beyond - f.motor[elbow].q);
         f.motor[elbow].q += static_cast<float>(off);
         f.motor[elbow].dq += 1.0f;
       },
       StopCause::kJointRange, 3.0}};
}

// F18: what a state says of the joints cannot be. One elbow goes up and down.
TEST(FaultMatrix, JointsThatCannotBeWhereTheySayHoldAndAreNotBelieved) {
  const int elbow = test::g1()->roles.arms[0][3];
  for (const Implausible& fault : implausible_joints()) {
    GuardedTwin robot(test::twin_guard(), noisy_joints());
    robot.start();
    const auto swing = [&] {
      robot.message.command.q[elbow] = test::g1()->neutral[elbow] + (robot.ticks / 500 % 2 == 0 ? 0.3 : -0.3);
    };
    for (int k = 0; k < 2000; ++k) {
      swing();
      robot.tick();
    }
    ASSERT_EQ(robot.state(), SafetyState::kRun) << fault.name << ": " << stop_cause_name(robot.cause());
    robot.spoil = in_each(fault.change);
    const double begin = robot.now;
    while (robot.state() == SafetyState::kRun && robot.now - begin < 4.0) {
      swing();
      robot.tick();
    }
    EXPECT_EQ(robot.state(), SafetyState::kHold) << fault.name;
    EXPECT_EQ(robot.cause(), fault.cause) << fault.name << ": " << stop_cause_name(robot.cause());
    EXPECT_LE(robot.now - begin, fault.within + 2.5 * kTick) << fault.name;
    EXPECT_GE(robot.guard.status().input.health.joints.joint, 0) << fault.name;
    const Eigen::VectorXd before = robot.guard.measured().q;
    robot.run_for(1.0);
    if (fault.cause == StopCause::kJointJump) {
      EXPECT_LT((robot.guard.measured().q - before).cwiseAbs().maxCoeff(), 0.1) << fault.name;
    }
    EXPECT_EQ(robot.state(), SafetyState::kHold) << fault.name;
    expect_inside(robot, fault.name);
  }
}

// Every state comes; a queue on the way grows by one now and then.
std::function<void(Frames&)> queued(std::size_t most, int every) {
  return [=, waiting = Frames(), k = 0](Frames& frames) mutable {
    waiting.insert(waiting.end(), frames.begin(), frames.end());
    frames.clear();
    if (++k % every == 0 && waiting.size() <= most) return;
    frames.push_back(waiting.front());
    waiting.pop_front();
  };
}

// F11: no state is older than 4 ms by its reception.
TEST(FaultMatrix, StatesThatComeLaterAndLaterHold) {
  GuardedTwin robot;
  robot.start();
  robot.spoil = queued(1000, 10);
  const double taken = robot.time_to_leave(SafetyState::kRun);
  EXPECT_EQ(robot.state(), SafetyState::kHold);
  EXPECT_EQ(robot.cause(), StopCause::kStateDelay);
  EXPECT_NEAR(taken, 10 * 0.05 + 0.1, 0.1);
  robot.run_for(1.0);
  expect_inside(robot, "delay");
  GuardedTwin little;
  little.start();
  little.spoil = queued(8, 10);
  little.run_for(3.0);
  EXPECT_EQ(little.state(), SafetyState::kRun);
}

TEST(FaultMatrix, StatesThatComeLateKeepItFromBeingArmed) {
  GuardedTwin robot;
  robot.run_for(1.5);
  robot.spoil = queued(15, 2);
  robot.run_for(4.0);
  EXPECT_EQ(robot.state(), SafetyState::kListen);
  EXPECT_EQ(robot.guard.status().safety.missing, "state_delay");
  EXPECT_NEAR(robot.guard.status().input.state_delay, 0.03, 0.003);
}

TEST(FaultMatrix, APlannerThatDiesHoldsWithoutEnd) {
  GuardedTwin robot;
  robot.start();
  robot.message.command.root.forward = 0.2;
  robot.run_for(1.0);
  robot.plans = false;
  EXPECT_NEAR(robot.time_to_leave(SafetyState::kRun), 0.6, 0.03);
  EXPECT_EQ(robot.cause(), StopCause::kPlannerAge);
  EXPECT_LT(robot.velocity.last.forward, 0.05);  // slowed down before it held
  const JointCommand frozen = robot.guard.joints();
  robot.run_for(30.0);
  EXPECT_EQ(robot.state(), SafetyState::kHold);
  EXPECT_EQ(robot.velocity.last.forward, 0.0);
  EXPECT_LT((robot.guard.joints().q_target - frozen.q_target).cwiseAbs().maxCoeff(), 0.03) << "the arms are frozen";
  EXPECT_EQ(robot.guard.joints().kp, frozen.kp);
  expect_inside(robot, "planner");
}

TEST(FaultMatrix, APausedGuardHoldsWithoutAStep) {
  for (const double pause : {0.15, 1.0}) {
    GuardedTwin robot;
    robot.start();
    robot.message.command.root.forward = 0.2;
    robot.run_for(1.0);
    for (double left = pause; left > 0.0; left -= kTick) robot.step_twin();
    robot.now += pause;
    robot.tick();
    EXPECT_EQ(robot.state(), SafetyState::kHold) << pause;
    EXPECT_EQ(robot.cause(), StopCause::kLoopLate) << pause;
    robot.run_for(0.5);
    expect_inside(robot, "pause");
  }
}

TEST(FaultMatrix, TheDeadManStopsInAFifthOfASecond) {
  GuardedTwin robot;
  robot.start();
  robot.drop_key(RemoteKey::kR1);
  EXPECT_NEAR(robot.time_to_leave(SafetyState::kRun), 0.2, 0.01);
  EXPECT_EQ(robot.cause(), StopCause::kDeadMan);
}

TEST(FaultMatrix, OdometryThatStopsOrJumpsHolds) {
  GuardedTwin stopped;
  stopped.start();
  stopped.measures = false;
  EXPECT_NEAR(stopped.time_to_leave(SafetyState::kRun), 0.15, 0.01);
  EXPECT_EQ(stopped.cause(), StopCause::kOdometryAge);
  GuardedTwin jumped;
  jumped.start();
  OdometrySample sample = jumped.twin.odometry(jumped.now);
  sample.X_WB.p.x() += 0.15;
  jumped.guard.receive(sample);
  jumped.tick();
  EXPECT_EQ(jumped.state(), SafetyState::kHold);
  EXPECT_EQ(jumped.cause(), StopCause::kOdometryJump);
}

TEST(FaultMatrix, APersonWhoDisappearsHolds) {
  GuardedTwin robot(test::twin_guard(true));
  robot.start();
  robot.sees = false;
  EXPECT_NEAR(robot.time_to_leave(SafetyState::kRun), 0.25, 0.04);
  EXPECT_EQ(robot.cause(), StopCause::kPersonAge);
}

TEST(FaultMatrix, APersonWhoTeleportsIsNotBelieved) {
  GuardedTwin robot(test::twin_guard(true));
  robot.start();
  robot.person.joints.colwise() += Eigen::Vector3d(3.0, 0.0, 0.0);
  robot.see();
  EXPECT_EQ(robot.guard.status().bad_messages, 1);
  robot.person.joints(0, 0) = std::numeric_limits<double>::quiet_NaN();
  robot.see();
  EXPECT_EQ(robot.guard.status().bad_messages, 2);
}

TEST(FaultMatrix, APersonWhoComesNearStopsTheRoot) {
  GuardedTwin robot(test::twin_guard(true));
  robot.start();
  robot.message.command.root.forward = 0.2;
  robot.run_for(1.0);
  EXPECT_GT(robot.velocity.last.forward, 0.1);
  for (int k = 0; k < 60; ++k) {  // walks up to the robot
    robot.person.joints.colwise() += Eigen::Vector3d(-0.05, 0.0, 0.0);
    robot.run_for(0.034);
  }
  robot.run_for(0.5);
  EXPECT_NEAR(robot.velocity.last.forward, 0.0, 1e-6);
  EXPECT_GT(counted(robot.guard.status().clamps, ClampReason::kSeparation), 0);
  EXPECT_EQ(robot.state(), SafetyState::kRun);
}

TEST(FaultMatrix, AJitterOfFiveCentimetresIsBorne) {
  GuardedTwin robot(test::twin_guard(true));
  robot.start();
  Random random(19, 9);
  const HumanJoints still = robot.person.joints;
  for (int k = 0; k < 60; ++k) {
    for (int j = 0; j < 24; ++j)
      for (int axis = 0; axis < 3; ++axis) robot.person.joints(axis, j) = still(axis, j) + random.uniform(-0.05, 0.05);
    robot.run_for(0.034);
  }
  EXPECT_EQ(robot.state(), SafetyState::kRun);
  EXPECT_EQ(robot.guard.status().bad_messages, 0);
}

}  // namespace
}  // namespace duet
