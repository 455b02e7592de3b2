#include "duet/hardware/safety_signal.h"

#include <algorithm>

namespace duet {
namespace {

constexpr std::array<std::string_view, kStopCauses> kCauseNames = {
    "none",           "state_age",  "bad_states",  "planner_age",   "person_age",  "odometry_age",
    "odometry_jump",  "remote_age", "dead_man",    "loop_late",     "clock",       "tilt",
    "joint_speed",    "gyro",       "temperature", "charge",        "motor_error", "mode",
    "foreign_writer", "stop_key",   "lapsed",      "held_too_long", "executor_age"};

StopLevel above(double value, double hold, double damp) {
  // Written so that a value that is not a number is the worst.
  if (!(value <= damp)) return StopLevel::kDamp;
  return value > hold ? StopLevel::kHold : StopLevel::kFine;
}

StopLevel damp_if(bool wrong) { return wrong ? StopLevel::kDamp : StopLevel::kFine; }
StopLevel hold_if(bool wrong) { return wrong ? StopLevel::kHold : StopLevel::kFine; }

void worsen(Assessment& all, StopLevel level, StopCause cause) {
  if (level > all.level) all = {level, cause};
}

int since(const BadStates& bad, double from) {
  return static_cast<int>(std::ranges::count_if(bad.at, [from](double at) { return at >= from; }));
}

StopLevel level_of_bad_states(const SafetyRules& rules, const BadStates& bad, double now) {
  if (since(bad, now - rules.damp_bad_time) >= rules.damp_bad_states) return StopLevel::kDamp;
  if (since(bad, now - rules.hold_bad_time) >= rules.hold_bad_states) return StopLevel::kHold;
  return since(bad, now - rules.damp_bad_time) > 0 ? StopLevel::kWarn : StopLevel::kFine;
}

void assess_clock(const SafetyRules& rules, const SafetyInput& input, double last_now, Assessment& all) {
  if (last_now == kNever) return;
  worsen(all, damp_if(!(input.now >= last_now)), StopCause::kClock);
  worsen(all, level_of(input.now - last_now - input.period, rules.loop), StopCause::kLoopLate);
}

void assess_robot(const SafetyRules& rules, const SafetyInput& input, const BadStates& bad, Assessment& all) {
  const RobotHealth& health = input.health;
  worsen(all, level_of(input.now - input.state_at, rules.state), StopCause::kStateAge);
  worsen(all, level_of_bad_states(rules, bad, input.now), StopCause::kBadStates);
  worsen(all, above(health.tilt, rules.hold_tilt, rules.damp_tilt), StopCause::kTilt);
  worsen(all, damp_if(!(health.joint_speed <= rules.joint_speed)), StopCause::kJointSpeed);
  worsen(all, damp_if(!(health.gyro <= rules.gyro)), StopCause::kGyro);
  worsen(all, above(health.casing, rules.hold_casing, rules.damp_casing), StopCause::kTemperature);
  worsen(all, above(health.winding, rules.hold_winding, rules.damp_winding), StopCause::kTemperature);
  worsen(all, hold_if(!(health.charge >= rules.charge)), StopCause::kCharge);
  worsen(all, damp_if(health.motor_error), StopCause::kMotorError);
  worsen(all, damp_if(!health.mode_is_expected), StopCause::kMode);
}

void assess_motion(const SafetyRules& rules, const SafetyInput& input, Assessment& all) {
  const double now = input.now;
  if (rules.person_present) worsen(all, level_of(now - input.person_at, rules.person), StopCause::kPersonAge);
  if (rules.walks) {
    worsen(all, level_of(now - input.odometry_at, rules.odometry), StopCause::kOdometryAge);
    worsen(all, hold_if(!(input.odometry_step <= rules.odometry_jump)), StopCause::kOdometryJump);
  }
  worsen(all, level_of(now - input.dead_man_at, rules.remote), StopCause::kDeadMan);
  worsen(all, level_of(now - input.planner_at, rules.planner), StopCause::kPlannerAge);
}

}  // namespace

std::string_view stop_cause_name(StopCause cause) { return kCauseNames[static_cast<std::size_t>(cause)]; }

void note_bad_states(int count, double now, BadStates& bad) {
  for (int k = 0; k < std::min(count, static_cast<int>(BadStates::kKept)); ++k) {
    std::rotate(bad.at.begin(), bad.at.end() - 1, bad.at.end());
    bad.at.front() = now;
  }
}

StopLevel level_of(double age, const AgeLimits& limits) {
  if (!(age <= limits.damp)) return StopLevel::kDamp;
  if (age > limits.hold) return StopLevel::kHold;
  return age > limits.warn ? StopLevel::kWarn : StopLevel::kFine;
}

Assessment assess(const SafetyRules& rules, const SafetyInput& input, const BadStates& bad, double last_now,
                  bool moving) {
  Assessment all;
  assess_clock(rules, input, last_now, all);
  assess_robot(rules, input, bad, all);
  worsen(all, level_of(input.now - input.remote_at, rules.remote), StopCause::kRemoteAge);
  worsen(all, hold_if(input.foreign_writer), StopCause::kForeignWriter);
  if (rules.executor_answers)
    worsen(all, level_of(input.now - input.executor_at, rules.executor), StopCause::kExecutorAge);
  worsen(all, damp_if(input.stop_key), StopCause::kStopKey);
  if (moving) assess_motion(rules, input, all);
  return all;
}

double planner_share(const SafetyRules& rules, double age) {
  if (!(age <= rules.planner.hold)) return 0.0;
  if (age <= rules.planner.warn) return 1.0;
  return rules.late_share * (rules.planner.hold - age) / (rules.planner.hold - rules.planner.warn);
}

}  // namespace duet
