// Which of the robot's motions are allowed now: a state machine as a pure function of the state before, the inputs and
// the caller's clock. docs/hardware.md, "States". It commands nothing; what it allows still passes the limiter.
#pragma once

#include <array>
#include <limits>
#include <string_view>

#include "duet/hardware/safety/joint_watch.h"

namespace duet {

// How well the links to the robot, the planner, the person and the operator are, and what follows from each: the table
// of docs/hardware.md, "Timeouts". Pure functions of times that the caller measured; nothing here reads a clock.

// The reaction that a signal asks for, from the mildest.
enum class StopLevel { kFine, kWarn, kHold, kDamp };

enum class StopCause {
  kNone,
  kStateAge,   // no good state of the robot
  kBadStates,  // states with a wrong checksum, a tick that does not rise, or a number that is not finite
  kPlannerAge,
  kPersonAge,
  kOdometryAge,
  kOdometryJump,
  kRemoteAge,  // nothing from the remote control
  kDeadMan,    // the operator lets go
  kLoopLate,   // this program was held up
  kClock,      // time went backwards
  kTilt,
  kJointSpeed,
  kGyro,
  kTemperature,
  kCharge,
  kMotorError,
  kMode,           // another robot, or another meaning of its joints, than configured
  kForeignWriter,  // somebody else commands the robot
  kStopKey,
  kLapsed,       // armed for too long without anything to do
  kLostWriter,   // what is written does not leave any more
  kExecutorAge,  // nothing from who executes the commands
  kStateDelay,   // states take longer to get here than the fastest did
  // A state says what cannot be (hardware/safety/joint_watch.h).
  kJointJump,
  kJointFrozen,
  kJointMismatch,
  kJointRange,
  kRope,  // its feet do not carry it: it does not begin to walk
};
inline constexpr std::size_t kStopCauses = 29;
std::string_view stop_cause_name(StopCause cause);  // "state_age", ...
// Its meaning and where to look, as a sentence for the screen; "" for kNone.
std::string_view stop_cause_text(StopCause cause);
std::string_view stop_cause_text(std::string_view name);  // the same by its name; "" for another

inline constexpr double kNever = -std::numeric_limits<double>::infinity();

inline constexpr double kNoLimit = std::numeric_limits<double>::infinity();

// An age at which a level begins [s]; a level that a signal does not have begins never.
struct AgeLimits {
  double warn, hold, damp = kNoLimit;
};

// The defaults are those of docs/hardware.md, "Timeouts"; a configuration cannot change them. A biped that is damped
// falls: only the stop key, a robot that falls already, a motor error, a robot that is not heard and a writer that is
// lost damp. Everything else holds, and a hold stands.
struct SafetyRules {
  AgeLimits state{0.006, 0.020, 0.100};
  AgeLimits planner{0.25, 0.6};
  AgeLimits person{0.1, 0.25};
  AgeLimits odometry{0.05, 0.15};
  AgeLimits remote{0.1, 0.2};
  AgeLimits executor{0.3, 0.6};                // read where `executor_answers`
  AgeLimits delay{0.020, 0.050};               // SafetyInput::state_delay
  AgeLimits loop{0.005, 0.040};                // by which a tick comes late
  AgeLimits writer{0.006, kNoLimit, 0.100};    // since a frame last left
  int hold_bad_states = 3;                     // within
  double hold_bad_time = 0.050;                // [s]
  double odometry_jump = 0.1;                  // [m]
  double hold_tilt = 0.5, damp_tilt = 1.0;     // [rad]
  double joint_speed_share = 1.0;              // RobotHealth
  double gyro = 6.0;                           // [rad/s]
  double start_tilt = 0.2;                     // beyond which it does not begin to walk [rad]
  double least_carried = 0.5;                  // RobotHealth::carried below which it does not
  bool stands_alone = false;                   // its executor keeps it on its feet: it stands before it is armed
  double warn_range = 0.02, hold_range = 0.1;  // of a joint beyond its limits: play and zero error; more [rad]
  // A warning is no reason to stop, but keeps it from being armed.
  double warn_casing = 75.0, hold_casing = 85.0;  // [degrees C]
  double warn_winding = 100.0, hold_winding = 120.0;
  double warn_charge = 30.0, hold_charge = 20.0;  // [%]
  double late_share = 0.5;                        // of speeds when the planner begins to be late; 0 at its hold
  double ready_time = 2.0;                        // for which everything has to be well before arming [s]
  double armed_time = 60.0;                       // idle, until it lapses [s]
  double hold_time = 2.0;                         // in which a late planner may end a hold by coming back [s]
  double damp_time = 5.0;                         // [s]
  bool person_present = true;                     // a person's pose is needed
  bool walks = true;                              // odometry is needed
  bool executor_answers = false;                  // who executes the commands is heard of, and has to be
};

// The robot's report on itself.
struct RobotHealth {
  double tilt = 0.0;                   // of the base's z axis from upright [rad]
  double joint_speed = 0.0;            // largest size [rad/s]
  double joint_speed_share = 0.0;      // of its limit that a joint used in each of the last three states, the largest
  double gyro = 0.0;                   // size [rad/s]
  double casing = 0.0, winding = 0.0;  // hottest motor [degrees C]
  double charge = 100.0;               // [%]; NaN: not known, which holds
  bool motor_error = false;
  bool mode_is_expected = true;  // mode_pr, mode_machine
  double carried = 1.0;          // share of its weight that its feet carry; NaN: not known
  JointDoubts joints;
};

// Clock readings are of one monotonic clock of this program, at reception [s].
struct SafetyInput {
  double now = 0.0;
  double period = 0.002;     // of ticks [s]
  double state_at = kNever;  // last good state of the robot
  int bad_states = 0;        // since the last tick
  double state_delay = 0.0;  // by which states come later than the fastest did, steadily [s]
  double planner_at = kNever, person_at = kNever, odometry_at = kNever, remote_at = kNever;
  double executor_at = kNever;
  double written_at = kNoLimit;  // when a frame last left, by ticks in which one should have; kNoLimit: none has to
  double odometry_step = 0.0;    // largest between two samples since the last tick [m]
  double dead_man_at = kNever;   // last time that the operator was seen to hold it
  RobotHealth health;
  bool foreign_writer = false;
  bool stop_key = false;
  bool arm = false;                    // the operator has armed (hardware/executors/executor.h); never set in a dry run
  bool stand = false, stands = false;  // asked to stand up; has stood up
  bool run = false;                    // asked to run, or to run again after a hold
};

// Times of the last bad states, the newest first.
struct BadStates {
  static constexpr std::size_t kKept = 10;
  std::array<double, kKept> at = [] {
    std::array<double, kKept> none{};
    none.fill(kNever);
    return none;
  }();
};
void note_bad_states(int count, double now, BadStates& bad);

struct Assessment {
  StopLevel level = StopLevel::kFine;
  StopCause cause = StopCause::kNone;  // of the highest level; the planner's where nothing else asks for it
};

// The level of one age.
StopLevel level_of(double age, const AgeLimits& limits);

// The assessment of everything that can be wrong in a state of the machine. `last_now`: of the tick before (kNever:
// none). `moving`: planner, person, odometry and dead-man count too.
Assessment assess(const SafetyRules& rules, const SafetyInput& input, const BadStates& bad, double last_now,
                  bool moving);

// The share of all speeds that a planner of this age [s] may still use.
double planner_share(const SafetyRules& rules, double age);

enum class SafetyState {
  kOffline,  // no robot has been heard of
  kListen,   // it is heard; something is missing before arming
  kReady,    // everything has been well for SafetyRules::ready_time
  kArmed,    // the operator has armed: joints are damped
  kStand,    // goes to its stance while the dead-man switch is held and nobody is near, and stands there
  kRun,      // follows the planner
  kHold,     // stands: root at rest, arms frozen, gains as they were; without end
  kDamp,     // joints are damped, for SafetyRules::damp_time
  kFault,    // damped until this program is started anew
};
inline constexpr int kSafetyStates = 9;
std::string_view safety_state_name(SafetyState state);  // "offline", ...

struct SafetyMemory {
  SafetyState state = SafetyState::kOffline;
  StopCause cause = StopCause::kNone;  // of the last hold, damping or fall back to listening
  double since = 0.0;                  // begin of the state [s]
  double well_since = kNever;          // from when everything that arming needs has been well; kNever: it is not
  double last_now = kNever;            // of the tick before
  std::string_view missing = {};       // why it was last not ready, while it listens
  bool commands = false;               // it has been armed: from then on the robot is never without commands
  bool let_go = false;                 // since the hold began the key that ends it was seen not to be held
  BadStates bad;
};

// The actions that a state allows.
struct SafetyOrder {
  bool writes = false;  // something is sent to the robot
  bool damps = false;   // and it is damping
  bool stands = false;  // or going to, and keeping, the stance
  double share = 0.0;   // of all speeds: of planned motion, or of the way to the stance
};

// One tick. `input.now` does not fall; where it does, the machine damps.
SafetyMemory next_safety(const SafetyRules& rules, const SafetyMemory& before, const SafetyInput& input);

SafetyOrder safety_order(const SafetyRules& rules, const SafetyMemory& memory, const SafetyInput& input);

// The cause that keeps a robot in kStand from moving on to its stance; kNone: none does.
StopCause stand_waits_for(const SafetyRules& rules, const SafetyInput& input);

// The cause that keeps a robot from beginning to walk, also after a hold: it leans, or hangs; kNone: none does.
StopCause walk_waits_for(const SafetyRules& rules, const SafetyInput& input);

// The condition that is missing for arming; empty where none is.
std::string_view missing_for_arming(const SafetyRules& rules, const SafetyMemory& memory, const SafetyInput& input);

}  // namespace duet
