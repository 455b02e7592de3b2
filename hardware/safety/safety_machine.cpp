#include "duet/hardware/safety/safety_machine.h"

#include <algorithm>
#include <array>

namespace duet {
namespace {

constexpr std::array<std::string_view, kSafetyStates> kStateNames = {"offline", "listen", "ready", "armed", "stand",
                                                                     "run",     "hold",   "damp",  "fault"};

void enter(SafetyState state, StopCause cause, double now, SafetyMemory& memory) {
  memory.state = state;
  memory.cause = cause;
  memory.since = now;
  memory.commands = memory.commands || state == SafetyState::kArmed;
  memory.let_go = false;
}

void listen(const SafetyRules& rules, const SafetyInput& input, SafetyMemory& memory) {
  const std::string_view missing = missing_for_arming(rules, memory, input);
  const bool well = missing.empty();
  if (!well) {
    memory.well_since = kNever;
    memory.missing = missing;
  }
  if (well && memory.well_since == kNever) memory.well_since = input.now;
  const bool ready = well && input.now - memory.well_since >= rules.ready_time;
  if (memory.state == SafetyState::kListen && ready) enter(SafetyState::kReady, StopCause::kNone, input.now, memory);
  if (memory.state == SafetyState::kReady && !ready) enter(SafetyState::kListen, StopCause::kNone, input.now, memory);
  if (memory.state == SafetyState::kReady && input.arm) enter(SafetyState::kArmed, StopCause::kNone, input.now, memory);
}

// Whether the signals have ended the state.
bool stopped(const SafetyRules& rules, const SafetyInput& input, bool moving, SafetyMemory& memory) {
  const Assessment found = assess(rules, input, memory.bad, memory.last_now, moving);
  if (found.level == StopLevel::kDamp)
    enter(SafetyState::kDamp, found.cause, input.now, memory);
  else if (found.level == StopLevel::kHold)
    enter(SafetyState::kHold, found.cause, input.now, memory);
  return found.level >= StopLevel::kHold;
}

// Damped already: what would hold anything else ends the arming.
void wait_armed(const SafetyRules& rules, const SafetyInput& input, SafetyMemory& memory) {
  const Assessment found = assess(rules, input, memory.bad, memory.last_now, false);
  if (found.level >= StopLevel::kHold) return enter(SafetyState::kDamp, found.cause, input.now, memory);
  if (input.now - memory.since > rules.armed_time)
    return enter(SafetyState::kDamp, StopCause::kLapsed, input.now, memory);
  if (input.stand) enter(SafetyState::kStand, StopCause::kNone, input.now, memory);
}

void stand(const SafetyRules& rules, const SafetyInput& input, SafetyMemory& memory) {
  if (stopped(rules, input, false, memory)) return;
  const bool well = assess(rules, input, memory.bad, memory.last_now, true).level < StopLevel::kHold;
  const bool may_walk = walk_waits_for(rules, input) == StopCause::kNone;
  if (input.run && input.stands && well && may_walk) enter(SafetyState::kRun, StopCause::kNone, input.now, memory);
}

// Whether a hold ends without anybody asking: nothing but the planner was late, and not for long.
bool may_return(const SafetyRules& rules, const SafetyMemory& memory, const SafetyInput& input) {
  return memory.cause == StopCause::kPlannerAge && input.now - memory.since <= rules.hold_time;
}

// Lasts until all is well again and the operator asks for what it held: to run, or, before it stood, to stand.
void hold(const SafetyRules& rules, const SafetyInput& input, SafetyMemory& memory) {
  const Assessment found = assess(rules, input, memory.bad, memory.last_now, true);
  if (found.level == StopLevel::kDamp) return enter(SafetyState::kDamp, found.cause, input.now, memory);
  if (found.level == StopLevel::kHold && found.cause != StopCause::kPlannerAge) memory.cause = found.cause;
  const bool asks = input.stands ? input.run : input.stand;
  memory.let_go = memory.let_go || (input.remote_at == input.now && !asks);  // not heard: it may still be held
  const bool anew = memory.let_go && asks;
  if (!input.stands) {
    const bool well = assess(rules, input, memory.bad, memory.last_now, false).level < StopLevel::kHold;
    if (well && anew) enter(SafetyState::kStand, StopCause::kNone, input.now, memory);
    return;
  }
  const bool asked = anew && walk_waits_for(rules, input) == StopCause::kNone;
  if (found.level < StopLevel::kHold && (asked || may_return(rules, memory, input)))
    enter(SafetyState::kRun, StopCause::kNone, input.now, memory);
}

// A stop that the operator asked for, or an arming that lapsed, may be followed by another arming; nothing else.
void damp(const SafetyRules& rules, const SafetyInput& input, SafetyMemory& memory) {
  const bool asked_for = memory.cause == StopCause::kStopKey || memory.cause == StopCause::kLapsed;
  const Assessment found = assess(rules, input, memory.bad, memory.last_now, false);
  if (asked_for && found.level == StopLevel::kDamp && found.cause != StopCause::kStopKey) memory.cause = found.cause;
  if (input.now - memory.since < rules.damp_time) return;
  const bool again = memory.cause == StopCause::kStopKey || memory.cause == StopCause::kLapsed;
  memory.well_since = kNever;
  enter(again ? SafetyState::kListen : SafetyState::kFault, memory.cause, input.now, memory);
}

}  // namespace

std::string_view safety_state_name(SafetyState state) { return kStateNames[static_cast<std::size_t>(state)]; }

std::string_view missing_for_arming(const SafetyRules& rules, const SafetyMemory& memory, const SafetyInput& input) {
  const Assessment found = assess(rules, input, memory.bad, memory.last_now, false);
  if (found.level >= StopLevel::kHold) return stop_cause_name(found.cause);
  const RobotHealth& health = input.health;
  if (health.charge < rules.warn_charge) return stop_cause_name(StopCause::kCharge);
  if (health.casing > rules.warn_casing || health.winding > rules.warn_winding)
    return stop_cause_name(StopCause::kTemperature);
  if (health.joints.excess > rules.warn_range) return stop_cause_name(StopCause::kJointRange);
  if (input.state_delay > rules.delay.warn) return stop_cause_name(StopCause::kStateDelay);
  const StopCause walking = rules.stands_alone ? walk_waits_for(rules, input) : StopCause::kNone;
  return walking == StopCause::kNone ? "" : stop_cause_name(walking);
}

SafetyMemory next_safety(const SafetyRules& rules, const SafetyMemory& before, const SafetyInput& input) {
  SafetyMemory memory = before;
  note_bad_states(input.bad_states, input.now, memory.bad);
  switch (before.state) {
    case SafetyState::kOffline:
      if (input.state_at != kNever) enter(SafetyState::kListen, StopCause::kNone, input.now, memory);
      break;
    case SafetyState::kListen:
    case SafetyState::kReady:
      listen(rules, input, memory);
      break;
    case SafetyState::kArmed:
      wait_armed(rules, input, memory);
      break;
    case SafetyState::kStand:
      stand(rules, input, memory);
      break;
    case SafetyState::kRun:
      stopped(rules, input, true, memory);
      break;
    case SafetyState::kHold:
      hold(rules, input, memory);
      break;
    case SafetyState::kDamp:
      damp(rules, input, memory);
      break;
    case SafetyState::kFault:
      break;
  }
  memory.last_now = input.now;
  return memory;
}

SafetyOrder safety_order(const SafetyRules& rules, const SafetyMemory& memory, const SafetyInput& input) {
  SafetyOrder order;
  const bool moves = memory.state == SafetyState::kRun || memory.state == SafetyState::kHold;
  order.writes = memory.commands;
  order.stands = memory.state == SafetyState::kStand;
  order.damps = order.writes && !order.stands && !moves;
  if (memory.state == SafetyState::kRun) order.share = planner_share(rules, input.now - input.planner_at);
  if (order.stands && stand_waits_for(rules, input) == StopCause::kNone) order.share = 1.0;
  return order;
}

StopCause stand_waits_for(const SafetyRules& rules, const SafetyInput& input) {
  if (level_of(input.now - input.dead_man_at, rules.remote) >= StopLevel::kHold) return StopCause::kDeadMan;
  const bool seen = level_of(input.now - input.person_at, rules.person) < StopLevel::kHold;
  return rules.person_present && !seen ? StopCause::kPersonAge : StopCause::kNone;
}

StopCause walk_waits_for(const SafetyRules& rules, const SafetyInput& input) {
  if (!(input.health.tilt <= rules.start_tilt)) return StopCause::kTilt;
  return input.health.carried >= rules.least_carried ? StopCause::kNone : StopCause::kRope;
}

namespace {

struct CauseText {
  std::string_view name, text;
};
constexpr std::array<CauseText, kStopCauses> kCauses = {{
    {"none", ""},
    {"state_age", "no good state of the robot comes: look at cable, domain and what else loads the network"},
    {"bad_states",
     "states come with a wrong checksum, an old count or numbers that are none: is there another sender?"},
    {"planner_age", "no good command of the planner comes: start it anew, or look at what it sends"},
    {"person_age", "nobody says where the person is: look at the camera and at why estimates are refused"},
    {"odometry_age", "nothing measures the robot's place: look at the source of odometry"},
    {"odometry_jump", "the measured place jumped: begin only when its source is steady again"},
    {"remote_age", "the remote control is not heard: switch it on, come nearer"},
    {"dead_man", "R1 was let go: hold it to go on"},
    {"loop_late", "this program was held up: end what else runs here, give it real-time priority"},
    {"clock", "the clock went backwards"},
    {"tilt", "the robot leans: look at its feet, its rope and its IMU"},
    {"joint_speed", "a joint is too fast, three states in a row"},
    {"gyro", "the trunk turns too fast"},
    {"temperature", "a motor is hot: let it rest until it is below the warning"},
    {"charge", "the battery is low, or does not say its charge: change it"},
    {"motor_error", "a motor reports an error: read its code in the log, and do not go on before it is known"},
    {"mode", "mode_machine or mode_pr is another than configured: another robot, or debug mode half entered"},
    {"foreign_writer", "somebody else commands the robot: end that program, or release the motion service"},
    {"stop_key", "the operator stopped it"},
    {"lapsed", "it was armed for a minute and nothing was asked of it"},
    {"lost_writer", "commands do not leave this computer: look at the network"},
    {"executor_age", "the program that executes the commands is not heard or not well"},
    {"state_delay",
     "states come later and later: a queue fills somewhere; look at wireless links and at what else sends"},
    {"joint_jump", "a joint's angle jumped and has not come back: encoder, wiring or order of the joints"},
    {"joint_frozen", "angle, speed and torque of joints stand still to the bit while states come: their bus hangs"},
    {"joint_mismatch", "a joint's speed is not that of its angle: order of the joints, or a sensor"},
    {"joint_range", "a joint is beyond its limits: its zero is wrong, or it was calibrated in another pose"},
    {"rope", "its feet do not carry it, or its knees are straight: let the rope down until it stands by itself"},
}};

StopLevel damp_if(bool wrong) { return wrong ? StopLevel::kDamp : StopLevel::kFine; }
StopLevel hold_if(bool wrong) { return wrong ? StopLevel::kHold : StopLevel::kFine; }

void worsen(Assessment& all, StopLevel level, StopCause cause) {
  if (level > all.level) all = {level, cause};
}

int since(const BadStates& bad, double from) {
  return static_cast<int>(std::ranges::count_if(bad.at, [from](double at) { return at >= from; }));
}

StopLevel level_of_bad_states(const SafetyRules& rules, const BadStates& bad, double now) {
  const int count = since(bad, now - rules.hold_bad_time);
  if (count >= rules.hold_bad_states) return StopLevel::kHold;
  return count > 0 ? StopLevel::kWarn : StopLevel::kFine;
}

void assess_clock(const SafetyRules& rules, const SafetyInput& input, double last_now, Assessment& all) {
  if (last_now == kNever) return;
  worsen(all, hold_if(!(input.now >= last_now)), StopCause::kClock);
  worsen(all, level_of(input.now - last_now - input.period, rules.loop), StopCause::kLoopLate);
}

void assess_robot(const SafetyRules& rules, const SafetyInput& input, const BadStates& bad, Assessment& all) {
  const RobotHealth& health = input.health;
  worsen(all, level_of(input.now - input.state_at, rules.state), StopCause::kStateAge);
  worsen(all, level_of_bad_states(rules, bad, input.now), StopCause::kBadStates);
  worsen(all, level_of(health.tilt, {kNoLimit, rules.hold_tilt, rules.damp_tilt}), StopCause::kTilt);
  worsen(all, hold_if(!(health.joint_speed_share <= rules.joint_speed_share)), StopCause::kJointSpeed);
  worsen(all, hold_if(!(health.gyro <= rules.gyro)), StopCause::kGyro);
  worsen(all, hold_if(health.joints.jump), StopCause::kJointJump);
  worsen(all, level_of(health.joints.excess, {rules.warn_range, rules.hold_range}), StopCause::kJointRange);
  worsen(all, hold_if(health.joints.frozen), StopCause::kJointFrozen);
  worsen(all, hold_if(health.joints.mismatch), StopCause::kJointMismatch);
  worsen(all, level_of(input.state_delay, rules.delay), StopCause::kStateDelay);
  worsen(all, level_of(health.casing, {rules.warn_casing, rules.hold_casing}), StopCause::kTemperature);
  worsen(all, level_of(health.winding, {rules.warn_winding, rules.hold_winding}), StopCause::kTemperature);
  worsen(all, level_of(-health.charge, {-rules.warn_charge, -rules.hold_charge}), StopCause::kCharge);
  worsen(all, damp_if(health.motor_error), StopCause::kMotorError);
  worsen(all, hold_if(!health.mode_is_expected), StopCause::kMode);
  worsen(all, level_of(input.now - input.written_at, rules.writer), StopCause::kLostWriter);
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

std::string_view stop_cause_name(StopCause cause) { return kCauses[static_cast<std::size_t>(cause)].name; }
std::string_view stop_cause_text(StopCause cause) { return kCauses[static_cast<std::size_t>(cause)].text; }
std::string_view stop_cause_text(std::string_view name) {
  const auto found = std::ranges::find(kCauses, name, &CauseText::name);
  return found == kCauses.end() ? "" : found->text;
}

void note_bad_states(int count, double now, BadStates& bad) {
  for (int k = 0; k < std::min(count, static_cast<int>(BadStates::kKept)); ++k) {
    std::rotate(bad.at.begin(), bad.at.end() - 1, bad.at.end());
    bad.at.front() = now;
  }
}

// Written so that a value that is not a number is the worst.
StopLevel level_of(double age, const AgeLimits& limits) {
  if (limits.damp < kNoLimit && !(age <= limits.damp)) return StopLevel::kDamp;
  if (!(age <= limits.hold)) return StopLevel::kHold;
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
