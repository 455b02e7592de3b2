// Each timeout and each threshold by its name, just before and just after it.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <set>

#include "duet/hardware/safety/safety_machine.h"

namespace duet {
namespace {

constexpr double kNow = 50.0;
constexpr double kNan = std::numeric_limits<double>::quiet_NaN();

SafetyInput well() {
  SafetyInput input;
  input.now = kNow;
  input.state_at = input.planner_at = input.person_at = input.odometry_at = kNow;
  input.remote_at = input.dead_man_at = input.executor_at = kNow;
  return input;
}

// Rules for a robot whose executor answers.
SafetyRules answered() {
  SafetyRules rules;
  rules.executor_answers = true;
  return rules;
}

Assessment assessed(const SafetyInput& input, bool moving = true, const SafetyRules& rules = {}) {
  return assess(rules, input, {}, kNow - input.period, moving);
}

TEST(SafetySignals, EverythingWellIsFine) {
  EXPECT_EQ(assessed(well()).level, StopLevel::kFine);
  EXPECT_EQ(assessed(well()).cause, StopCause::kNone);
}

struct Timeout {
  const char* name;
  double SafetyInput::*at;
  AgeLimits expected;  // the table of docs/hardware.md
  StopCause cause;
};

constexpr double kForever = std::numeric_limits<double>::infinity();
const Timeout kTimeouts[] = {
    {"state", &SafetyInput::state_at, {0.006, 0.020, 0.100}, StopCause::kStateAge},
    {"planner", &SafetyInput::planner_at, {0.25, 0.6, kForever}, StopCause::kPlannerAge},
    {"person", &SafetyInput::person_at, {0.1, 0.25, kForever}, StopCause::kPersonAge},
    {"odometry", &SafetyInput::odometry_at, {0.05, 0.15, kForever}, StopCause::kOdometryAge},
    {"remote", &SafetyInput::remote_at, {0.1, 0.2, kForever}, StopCause::kRemoteAge},
    {"dead man", &SafetyInput::dead_man_at, {0.1, 0.2, kForever}, StopCause::kDeadMan},
    {"executor", &SafetyInput::executor_at, {0.3, 0.6, kForever}, StopCause::kExecutorAge},
    {"writer", &SafetyInput::written_at, {0.006, kForever, 0.100}, StopCause::kLostWriter},
};

void expect_level_after(const Timeout& timeout, double age, StopLevel level) {
  if (age == kForever) return;
  SafetyInput input = well();
  input.*timeout.at = kNow - age;
  const Assessment found = assessed(input, true, answered());
  EXPECT_EQ(found.level, level) << timeout.name << " after " << age;
  if (level != StopLevel::kFine) {
    EXPECT_EQ(found.cause, timeout.cause) << timeout.name;
  }
}

TEST(SafetySignals, EachAgeHasItsWarningHoldAndDamping) {
  constexpr double kALittle = 1e-4;
  for (const Timeout& timeout : kTimeouts) {
    expect_level_after(timeout, timeout.expected.warn - kALittle, StopLevel::kFine);
    expect_level_after(timeout, timeout.expected.warn + kALittle, StopLevel::kWarn);
    expect_level_after(timeout, timeout.expected.hold - kALittle, StopLevel::kWarn);
    expect_level_after(timeout, timeout.expected.hold + kALittle, StopLevel::kHold);
    const StopLevel before = timeout.expected.hold == kForever ? StopLevel::kWarn : StopLevel::kHold;
    expect_level_after(timeout, timeout.expected.damp - kALittle, before);
    expect_level_after(timeout, timeout.expected.damp + kALittle, StopLevel::kDamp);
  }
}

TEST(SafetySignals, WhatHasNeverComeHolds) {
  for (const Timeout& timeout : kTimeouts) {
    SafetyInput input = well();
    input.*timeout.at = kNever;
    EXPECT_GE(assessed(input, true, answered()).level, StopLevel::kHold) << timeout.name;
  }
}

TEST(SafetySignals, ATimeThatIsNotANumberIsTheWorst) {
  for (const Timeout& timeout : kTimeouts) {
    SafetyInput input = well();
    input.*timeout.at = kNan;
    const StopLevel worst = timeout.expected.damp == kForever ? StopLevel::kHold : StopLevel::kDamp;
    EXPECT_EQ(assessed(input, true, answered()).level, worst) << timeout.name;
  }
}

TEST(SafetySignals, ATickThatComesLate) {
  SafetyInput input = well();
  const auto late = [&](double seconds) { return assess({}, input, {}, kNow - input.period - seconds, true); };
  EXPECT_EQ(late(0.004).level, StopLevel::kFine);
  EXPECT_EQ(late(0.006).level, StopLevel::kWarn);
  EXPECT_EQ(late(0.039).level, StopLevel::kWarn);
  EXPECT_EQ(late(0.041).level, StopLevel::kHold);
  EXPECT_EQ(late(10.0).level, StopLevel::kHold);
  EXPECT_EQ(late(0.101).cause, StopCause::kLoopLate);
}

TEST(SafetySignals, AClockThatFallsHolds) {
  const Assessment found = assess({}, well(), {}, kNow + 0.001, true);
  EXPECT_EQ(found.level, StopLevel::kHold);
  EXPECT_EQ(found.cause, StopCause::kClock);
}

BadStates bad_states(int count, double spacing) {
  BadStates bad;
  for (int k = count - 1; k >= 0; --k) note_bad_states(1, kNow - k * spacing, bad);
  return bad;
}

TEST(SafetySignals, ABadStateCountsToTheEndOfItsTime) {
  const SafetyRules rules;
  const auto level = [&](double oldest) {
    BadStates bad;
    for (const double at : {oldest, kNow, kNow}) note_bad_states(1, at, bad);
    return assess(rules, well(), bad, kNow - 0.002, true).level;
  };
  const double end = kNow - rules.hold_bad_time;
  EXPECT_EQ(level(end), StopLevel::kHold);
  EXPECT_EQ(level(std::nextafter(end, 0.0)), StopLevel::kWarn);
}

TEST(SafetySignals, BadStatesWarnAndHoldByTheirNumber) {
  const auto level = [](const BadStates& bad) { return assess({}, well(), bad, kNow - 0.002, true).level; };
  EXPECT_EQ(level(bad_states(1, 0.002)), StopLevel::kWarn);
  EXPECT_EQ(level(bad_states(2, 0.002)), StopLevel::kWarn);
  EXPECT_EQ(level(bad_states(3, 0.024)), StopLevel::kHold);
  EXPECT_EQ(level(bad_states(3, 0.026)), StopLevel::kWarn);
  EXPECT_EQ(level(bad_states(10, 0.002)), StopLevel::kHold);
}

TEST(SafetySignals, ManyBadStatesInOneTickCountAll) {
  BadStates bad;
  note_bad_states(1000, kNow, bad);
  EXPECT_EQ(assess({}, well(), bad, kNow, true).level, StopLevel::kHold);
}

struct Threshold {
  const char* name;
  double RobotHealth::*value;
  double warn, hold, damp;  // where it begins; infinity: never
  StopCause cause;
};

StopLevel level_at(const Threshold& t, double value) {
  SafetyInput input = well();
  input.health.*t.value = value;
  const Assessment found = assessed(input);
  EXPECT_TRUE(found.level == StopLevel::kFine || found.cause == t.cause) << t.name;
  return found.level;
}

TEST(SafetySignals, TheRobotsHealthWarnsHoldsOrDamps) {
  constexpr double kALittle = 1e-3;
  for (const Threshold& t :
       {Threshold{"tilt", &RobotHealth::tilt, kForever, 0.5, 1.0, StopCause::kTilt},
        Threshold{"joint speed", &RobotHealth::joint_speed_share, kForever, 1.0, kForever, StopCause::kJointSpeed},
        Threshold{"gyro", &RobotHealth::gyro, kForever, 6.0, kForever, StopCause::kGyro},
        Threshold{"casing", &RobotHealth::casing, 75.0, 85.0, kForever, StopCause::kTemperature},
        Threshold{"winding", &RobotHealth::winding, 100.0, 120.0, kForever, StopCause::kTemperature}}) {
    EXPECT_EQ(level_at(t, std::min(t.warn, t.hold) - kALittle), StopLevel::kFine) << t.name;
    if (t.warn < kForever) {
      EXPECT_EQ(level_at(t, t.warn + kALittle), StopLevel::kWarn) << t.name;
    }
    EXPECT_EQ(level_at(t, t.hold + kALittle), StopLevel::kHold) << t.name;
    if (t.damp < kForever) {
      EXPECT_EQ(level_at(t, t.damp - kALittle), StopLevel::kHold) << t.name;
      EXPECT_EQ(level_at(t, t.damp + kALittle), StopLevel::kDamp) << t.name;
    }
    EXPECT_EQ(level_at(t, kNan), t.damp < kForever ? StopLevel::kDamp : StopLevel::kHold) << t.name;
  }
}

void expect_stop(const std::function<void(SafetyInput&)>& spoil, StopLevel level, StopCause cause) {
  SafetyInput input = well();
  spoil(input);
  EXPECT_EQ(assessed(input).level, level) << stop_cause_name(cause);
  EXPECT_EQ(assessed(input).cause, cause);
}

TEST(SafetySignals, EverythingElseHasItsLevel) {
  expect_stop([](SafetyInput& in) { in.health.charge = 29.9; }, StopLevel::kWarn, StopCause::kCharge);
  expect_stop([](SafetyInput& in) { in.health.charge = 19.9; }, StopLevel::kHold, StopCause::kCharge);
  expect_stop([](SafetyInput& in) { in.health.charge = kNan; }, StopLevel::kHold, StopCause::kCharge);
  expect_stop([](SafetyInput& in) { in.health.motor_error = true; }, StopLevel::kDamp, StopCause::kMotorError);
  expect_stop([](SafetyInput& in) { in.health.mode_is_expected = false; }, StopLevel::kHold, StopCause::kMode);
  expect_stop([](SafetyInput& in) { in.foreign_writer = true; }, StopLevel::kHold, StopCause::kForeignWriter);
  expect_stop([](SafetyInput& in) { in.stop_key = true; }, StopLevel::kDamp, StopCause::kStopKey);
  expect_stop([](SafetyInput& in) { in.odometry_step = 0.101; }, StopLevel::kHold, StopCause::kOdometryJump);
  expect_stop([](SafetyInput& in) { in.health.joints.jump = true; }, StopLevel::kHold, StopCause::kJointJump);
  expect_stop([](SafetyInput& in) { in.health.joints.frozen = true; }, StopLevel::kHold, StopCause::kJointFrozen);
  expect_stop([](SafetyInput& in) { in.health.joints.mismatch = true; }, StopLevel::kHold, StopCause::kJointMismatch);
  expect_stop([](SafetyInput& in) { in.health.joints.excess = 0.021; }, StopLevel::kWarn, StopCause::kJointRange);
  expect_stop([](SafetyInput& in) { in.health.joints.excess = 0.101; }, StopLevel::kHold, StopCause::kJointRange);
  expect_stop([](SafetyInput& in) { in.state_delay = 0.021; }, StopLevel::kWarn, StopCause::kStateDelay);
  expect_stop([](SafetyInput& in) { in.state_delay = 0.051; }, StopLevel::kHold, StopCause::kStateDelay);
  expect_stop([](SafetyInput& in) { in.odometry_step = kNan; }, StopLevel::kHold, StopCause::kOdometryJump);
}

TEST(SafetySignals, StandingNeedsNeitherPlannerNorPersonNorOdometryNorDeadMan) {
  SafetyInput input = well();
  input.planner_at = input.person_at = input.odometry_at = input.dead_man_at = kNever;
  EXPECT_EQ(assessed(input, false).level, StopLevel::kFine);
}

TEST(SafetySignals, APersonAndOdometryCountWhereTheyAreNeeded) {
  SafetyRules rules;
  rules.person_present = rules.walks = false;
  SafetyInput input = well();
  input.person_at = input.odometry_at = kNever;
  EXPECT_EQ(assessed(input, true, rules).level, StopLevel::kFine);
}

TEST(SafetySignals, TheWorstIsNamedAndThePlannerLast) {
  SafetyInput input = well();
  input.planner_at = kNow - 1.0;
  input.person_at = kNow - 1.0;
  EXPECT_EQ(assessed(input).cause, StopCause::kPersonAge);
  input.health.tilt = 2.0;
  EXPECT_EQ(assessed(input).cause, StopCause::kTilt);
}

TEST(SafetySignals, ALatePlannerMayUseHalfAndThenLess) {
  const SafetyRules rules;
  EXPECT_EQ(planner_share(rules, 0.0), 1.0);
  EXPECT_EQ(planner_share(rules, 0.25), 1.0);
  EXPECT_NEAR(planner_share(rules, 0.2501), 0.5, 1e-3);
  EXPECT_NEAR(planner_share(rules, 0.425), 0.25, 1e-9);
  EXPECT_NEAR(planner_share(rules, 0.6), 0.0, 1e-9);
  EXPECT_EQ(planner_share(rules, 0.7), 0.0);
  EXPECT_EQ(planner_share(rules, kNan), 0.0);
}

TEST(SafetySignals, EachCauseHasItsOwnName) {
  std::set<std::string_view> names, texts;
  for (std::size_t k = 0; k < kStopCauses; ++k) {
    EXPECT_TRUE(names.insert(stop_cause_name(static_cast<StopCause>(k))).second) << k;
    EXPECT_TRUE(texts.insert(stop_cause_text(static_cast<StopCause>(k))).second) << k;
  }
  EXPECT_EQ(stop_cause_name(StopCause::kExecutorAge), "executor_age");
  EXPECT_EQ(stop_cause_name(StopCause::kJointRange), "joint_range");
}

}  // namespace
}  // namespace duet
