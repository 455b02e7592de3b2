// The table of faults in docs/hardware.md: each begins while the root walks at 0.2 m/s and an elbow swings, and is
// watched at the wire for 4 s of a simulated clock: the states that it leads to and when, commands outside their
// limits, what still moves in the last second. DUET_FAULT_TABLE=print prints the table.
#include <fmt/format.h>
#include <gmock/gmock.h>

#include <cstdlib>
#include <iostream>

#include "duet/core/file.h"
#include "tests/hardware/wire_faults.h"

namespace duet {
namespace {

using namespace test;

constexpr double kTick = GuardedTwin::kDt;
constexpr double kWatched = 4.0, kAtRest = 3.0;  // after the fault [s]
constexpr float kNan = std::numeric_limits<float>::quiet_NaN();
constexpr float kInf = std::numeric_limits<float>::infinity();

enum class Since { kTheStart, kArmed, kRunning };
enum class Beside { kNobody, kAPerson, kABattery };

struct Fault {
  const char* name;
  std::function<void(GuardedTwin&)> begin;
  SafetyState reached;  // first
  StopCause cause;
  double within;               // [s]
  SafetyState ends = reached;  // after kWatched
  Beside beside = Beside::kNobody;
  Since since = Since::kRunning;
};

// Faults of the robot's states.
std::function<void(GuardedTwin&)> states(const SpoiledFrames& spoil) {
  return [spoil](GuardedTwin& robot) { robot.spoil = spoil; };
}
std::function<void(GuardedTwin&)> field(const std::function<void(LowStateFrame&)>& change) {
  return states(in_each(change));
}
std::function<void(GuardedTwin&)> plans(const std::function<void(PlannerMessage&)>& spoil) {
  return [spoil](GuardedTwin& robot) { robot.spoil_plan = spoil; };
}
std::function<void(GuardedTwin&)> condition(const std::function<void(TwinCondition&)>& change) {
  return [change](GuardedTwin& robot) { change(robot.twin.condition); };
}

// By 1.5 rad in half a second.
void fall(GuardedTwin& robot) {
  robot.spoil = [&robot](Frames&) {
    robot.twin.condition.roll = std::min(robot.twin.condition.roll + 3.0 * kTick, 1.5);
  };
}

void ask_for_anything(PlannerMessage& message, Random& random) {
  for (int j = 0; j < kG1Motors; ++j) message.command.q[j] = random.uniform(-50.0, 50.0);
  VelocityCommand& root = message.command.root;
  for (double* speed : {&root.forward, &root.lateral, &root.yaw_rate, &root.height}) *speed = random.uniform(-9.0, 9.0);
}

std::vector<Fault> faults_of_planners() {
  using S = SafetyState;
  using C = StopCause;
  return {
      {"planner killed", [](GuardedTwin& r) { r.plans = false; }, S::kHold, C::kPlannerAge, 0.6},
      {"NaN in one target of every plan", plans([](PlannerMessage& m) { m.command.q[20] = kNan; }), S::kHold,
       C::kPlannerAge, 0.6},
      {"plans stamped 5 s back", plans([](PlannerMessage& m) { m.command.stamp -= 5.0; }), S::kHold, C::kPlannerAge,
       0.6},
      {"random plans, 50 rad and 9 m/s either way",
       plans([random = Random(7, 7)](PlannerMessage& m) mutable { ask_for_anything(m, random); }), S::kRun, C::kNone,
       0.0},
      {"plans that step by 4 rad and 2 m/s, both ways, twice a second", plans([](PlannerMessage& m) {
         const double sign = m.sequence / 12 % 2 == 0 ? 1.0 : -1.0;
         m.command.q.array() += sign * 2.0;
         m.command.root.forward = m.command.root.lateral = sign;
       }),
       S::kRun, C::kNone, 0.0},
  };
}

std::vector<Fault> faults_of_states() {
  using S = SafetyState;
  using C = StopCause;
  const SpoiledFrames nothing = [](Frames& f) { f.clear(); };
  const SpoiledFrames nan_angle = in_each([](LowStateFrame& f) { f.motor[5].q = kNan; });
  return {
      {"all states dropped", states(nothing), S::kHold, C::kStateAge, 0.020, S::kDamp},
      {"no state for 60 ms", states(for_ticks(30, nothing)), S::kHold, C::kStateAge, 0.020},
      {"5 % of states dropped", states(dropped(0.05)), S::kRun, C::kNone, 0.0},
      {"30 % of states dropped", states(dropped(0.3)), S::kRun, C::kNone, 0.0},
      {"half of the states dropped", states([k = 0](Frames& f) mutable {
         if (++k % 2 == 0) f.clear();
       }),
       S::kRun, C::kNone, 0.0},
      {"states 5 ms late", states(delayed(2)), S::kRun, C::kNone, 0.0},
      {"states 50 ms late", states(delayed(25)), S::kHold, C::kStateAge, 0.020},
      {"states 300 ms late", states(delayed(150)), S::kHold, C::kStateAge, 0.020, S::kDamp},
      {"states 300 ms late from the start (not noticed)", states(delayed(150)), S::kRun, C::kNone, 0.0, S::kRun,
       Beside::kNobody, Since::kTheStart},
      {"a bit flipped in 5 % of states", states(flipped_by_chance(0.05)), S::kHold, C::kBadStates, 1.0},
      {"a bit flipped in 30 % of states", states(flipped_by_chance(0.3)), S::kHold, C::kBadStates, 0.1},
      {"a bit flipped in every state", states(flipped(1)), S::kHold, C::kBadStates, 0.050, S::kDamp},
      {"tick stands still", states(frozen()), S::kHold, C::kBadStates, 0.050, S::kDamp},
      {"tick stands still from the start", states(frozen()), S::kListen, C::kNone, 0.0, S::kListen, Beside::kNobody,
       Since::kTheStart},
      {"tick 5000 back", field([](LowStateFrame& f) { f.tick -= 5000; }), S::kHold, C::kBadStates, 0.050, S::kDamp},
      {"NaN in an angle for 100 ms", states(for_ticks(50, nan_angle)), S::kHold, C::kBadStates, 0.050},
      {"infinity in a speed", field([](LowStateFrame& f) { f.motor[5].dq = kInf; }), S::kHold, C::kBadStates, 0.050,
       S::kDamp},
      {"1e30 in a speed", field([](LowStateFrame& f) { f.motor[5].dq = 1e30f; }), S::kHold, C::kJointSpeed, 0.004},
      {"NaN in a torque", field([](LowStateFrame& f) { f.motor[5].tau_est = kNan; }), S::kHold, C::kBadStates, 0.050,
       S::kDamp},
      {"NaN in the quaternion", field([](LowStateFrame& f) { f.imu.quaternion[0] = kNan; }), S::kHold, C::kBadStates,
       0.050, S::kDamp},
      {"NaN in the gyro", field([](LowStateFrame& f) { f.imu.gyroscope[0] = kNan; }), S::kHold, C::kBadStates, 0.050,
       S::kDamp},
      {"NaN in accelerometer, rpy, `ddq` and `vol` (odometry `legs` alone reads the first, and stops)",
       field([](LowStateFrame& f) { f.imu.accelerometer[0] = f.imu.rpy[0] = f.motor[5].ddq = f.motor[5].vol = kNan; }),
       S::kRun, C::kNone, 0.0},
      {"another `mode_machine`", field([](LowStateFrame& f) { f.mode_machine = 6; }), S::kHold, C::kMode, 0.0},
      {"another `mode_pr`", field([](LowStateFrame& f) { f.mode_pr = 1; }), S::kHold, C::kMode, 0.0},
  };
}

std::vector<Fault> faults_of_the_robot() {
  using S = SafetyState;
  using C = StopCause;
  return {
      {"casing at 88 degrees C", condition([](TwinCondition& t) { t.casing = 88.0; }), S::kHold, C::kTemperature, 0.0},
      {"winding at 125 degrees C", condition([](TwinCondition& t) { t.winding = 125.0; }), S::kHold, C::kTemperature,
       0.0},
      {"charge at 19 %", [](GuardedTwin& r) { r.guard.receive(BatteryReading{19.0}, r.now); }, S::kHold, C::kCharge,
       0.0, S::kHold, Beside::kABattery},
      {"joint speed of 12 rad/s", condition([](TwinCondition& t) { t.joint_speed = 12.0; }), S::kHold, C::kJointSpeed,
       0.004},
      {"gyro of 7 rad/s", condition([](TwinCondition& t) { t.gyro = 7.0; }), S::kHold, C::kGyro, 0.0},
      {"leans by 0.6 rad", condition([](TwinCondition& t) { t.roll = 0.6; }), S::kHold, C::kTilt, 0.0},
      {"falls by 1.5 rad in 0.5 s", fall, S::kHold, C::kTilt, 0.168, S::kDamp},
      {"the same while it is armed", fall, S::kDamp, C::kTilt, 0.168, S::kDamp, Beside::kNobody, Since::kArmed},
      {"motor error", condition([](TwinCondition& t) { t.motor_error = true; }), S::kDamp, C::kMotorError, 0.0},
      {"another writer", [](GuardedTwin& r) { r.wire.foreign = 1; }, S::kHold, C::kForeignWriter, 0.1},
      {"odometry stops", [](GuardedTwin& r) { r.measures = false; }, S::kHold, C::kOdometryAge, 0.15},
      {"odometry jumps by 0.15 m",
       [](GuardedTwin& r) {
         OdometrySample sample = r.twin.odometry(r.now);
         sample.X_WB.p.x() += 0.15;
         r.guard.receive(sample);
       },
       S::kHold, C::kOdometryJump, 0.0},
      {"the person is not seen any more", [](GuardedTwin& r) { r.sees = false; }, S::kHold, C::kPersonAge, 0.25,
       S::kHold, Beside::kAPerson},
      {"the guard stands still for 150 ms",
       [](GuardedTwin& r) {
         for (double left = 0.15; left > 0.0; left -= kTick) r.step_twin();
         r.now += 0.15;
       },
       S::kHold, C::kLoopLate, 0.0},
  };
}

std::vector<Fault> faults_of_the_remote_control() {
  using S = SafetyState;
  using C = StopCause;
  return {
      {"remote control lost", field([](LowStateFrame& f) { std::fill_n(f.wireless_remote, kRemoteBytes, 0); }),
       S::kHold, C::kRemoteAge, 0.2},
      {"R1 let go", [](GuardedTwin& r) { r.drop_key(RemoteKey::kR1); }, S::kHold, C::kDeadMan, 0.2},
      {"select while the root brakes",
       [](GuardedTwin& r) {
         r.message.command.root.forward = 0.0;
         r.run_for(0.1);
         r.hold_key(RemoteKey::kSelect);
       },
       S::kDamp, C::kStopKey, 0.0},
      {"L2 with B",
       [](GuardedTwin& r) {
         r.hold_key(RemoteKey::kL2);
         r.hold_key(RemoteKey::kB);
       },
       S::kDamp, C::kStopKey, 0.0},
  };
}

GuardSetup setup_beside(Beside beside) {
  GuardSetup setup = twin_guard(beside == Beside::kAPerson);
  setup.has_battery = beside == Beside::kABattery;
  return setup;
}

struct Reached {
  SafetyState state;
  StopCause cause;
  double after;  // [s]
};

// The record of the wire.
struct Record {
  std::vector<Reached> path;
  long outside = 0;                            // commands
  double joint_speed = 0.0, root_speed = 0.0;  // most in the last second [rad/s], [m/s]
  bool gains_after_damping = false;
};

class Trial {
 public:
  explicit Trial(const Fault& fault) : robot_(setup_beside(fault.beside), noisy_twin(1.0, "", 1)) {
    robot_.guard.receive(BatteryReading{50.0}, robot_.now);
    if (fault.since == Since::kTheStart) {
      fault.begin(robot_);
      robot_.run_for(0.5);
    }
    if (fault.since == Since::kArmed) {
      robot_.hold_key(RemoteKey::kR1);
      robot_.run_for(2.2);
      robot_.guard.arm();
      robot_.run_for(0.5);
    } else {
      robot_.start();
      robot_.message.command.root.forward = 0.2;
      for (int k = 0; k < 500; ++k) tick();
    }
    before_ = robot_.state();
    if (fault.since != Since::kTheStart) fault.begin(robot_);
  }
  [[nodiscard]] SafetyState before() const { return before_; }

  Record record() {
    Record seen;
    SafetyState state = before_;
    const double begin = robot_.now;
    while (robot_.now - begin < kWatched) {
      tick();
      const double after = robot_.now - begin;
      if (robot_.state() != state) seen.path.push_back({robot_.state(), robot_.cause(), after});
      state = robot_.state();
      if (state == SafetyState::kDamp) seen.gains_after_damping = seen.gains_after_damping || !robot_.last_damps;
      if (after > kAtRest) {
        seen.joint_speed = std::max(seen.joint_speed, joint_speed_);
        seen.root_speed = std::max(seen.root_speed, robot_.twin.root_speed());
      }
    }
    seen.outside = robot_.bad_frames + robot_.fast_targets + robot_.twin.refused_frames();
    return seen;
  }

 private:
  void tick() {
    const int elbow = g1()->roles.arms[0][3];
    robot_.message.command.q[elbow] = g1()->neutral[elbow] + (robot_.ticks / 500 % 2 == 0 ? 0.3 : -0.3);
    const Eigen::VectorXd q = robot_.twin.q();
    robot_.tick();
    joint_speed_ = (robot_.twin.q() - q).cwiseAbs().maxCoeff() / kTick;
  }

  GuardedTwin robot_;
  SafetyState before_ = SafetyState::kOffline;
  double joint_speed_ = 0.0;
};

bool goes_on(const Fault& fault) { return fault.ends == SafetyState::kRun || fault.ends == SafetyState::kListen; }
// The noise of the measured pose moves arms whose weight is fed forward by a hundredth.
constexpr double kStillJoint = 0.02;  // [rad/s]
constexpr double kStillRoot = 0.001;  // [m/s]

bool rests(const Record& seen) {
  return seen.joint_speed < kStillJoint && seen.root_speed < kStillRoot && !seen.gains_after_damping;
}

std::string line_of(const Fault& fault, SafetyState before, const Record& seen) {
  std::string path, times;
  for (const Reached& reached : seen.path) {
    path += fmt::format("{}{} (`{}`)", path.empty() ? "" : ", ", safety_state_name(reached.state),
                        stop_cause_name(reached.cause));
    times += fmt::format("{}{:.3f}", times.empty() ? "" : ", ", reached.after);
  }
  if (path.empty()) path = fmt::format("stays in {}", safety_state_name(before)), times = "-";
  const std::string motion = goes_on(fault) ? "-"
                             : rests(seen)  ? "none"
                                           : fmt::format("{:.3f} rad/s, {:.3f} m/s", seen.joint_speed, seen.root_speed);
  return fmt::format("| {} | {} | {} | {} | {} |\n", fault.name, path, times, seen.outside, motion);
}

TEST(FaultMatrix, EachFaultReachesItsStateAsThePageSays) {
  std::string table =
      "| fault | state reached | after [s] | commands outside limits | motion after the stop "
      "|\n|---|---|---|---|---|\n";
  for (const auto& faults :
       {faults_of_planners(), faults_of_states(), faults_of_the_robot(), faults_of_the_remote_control()})
    for (const Fault& fault : faults) {
      Trial trial(fault);
      ASSERT_TRUE(trial.before() == SafetyState::kRun || fault.since != Since::kRunning) << fault.name;
      const Record seen = trial.record();
      table += line_of(fault, trial.before(), seen);
      EXPECT_EQ(seen.outside, 0) << fault.name;
      const Reached last = seen.path.empty() ? Reached{trial.before(), StopCause::kNone, 0.0} : seen.path.back();
      const Reached first = seen.path.empty() ? last : seen.path.front();
      EXPECT_EQ(first.state, fault.reached) << fault.name;
      EXPECT_EQ(first.cause, fault.cause) << fault.name << ": " << stop_cause_name(first.cause);
      EXPECT_LE(first.after, fault.within + 2.5 * kTick) << fault.name;
      EXPECT_EQ(last.state, fault.ends) << fault.name;
      EXPECT_TRUE(goes_on(fault) || rests(seen)) << fault.name << " " << seen.joint_speed << " " << seen.root_speed;
    }
  if (const char* print = std::getenv("DUET_FAULT_TABLE"); print != nullptr) std::cout << table;
  const std::string page = read_text(std::string(DUET_SOURCE_DIR) + "/docs/hardware.md");
  EXPECT_NE(page.find(table), std::string::npos) << "docs/hardware.md: expected this table, found another:\n" << table;
}

}  // namespace
}  // namespace duet
