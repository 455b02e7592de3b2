#include "duet/hardware/episodes/hold_trial.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <optional>

#include "duet/core/numbers.h"
#include "duet/hardware/guard/robot_connection.h"
#include "duet/hardware/twin/lock_step.h"

namespace duet {
namespace {

constexpr double kRunsBy = 9.5;        // of the twin's time; it walks from then on for up to a stride or two [s]
constexpr double kAnyStride = 1.0;     // [s]
constexpr double kShort = 0.02;        // of a fault that is one glitch [s]
constexpr double kGap = 0.06;          // in which no state comes, or nobody ticks the guard [s]
constexpr double kPlanPeriod = 0.02;   // [s]
constexpr double kAskedFor = 2.0;      // after the hold, to run again [s]
constexpr double kArmSwing = 0.3;      // that the planner asks of both elbows [rad]
constexpr int kElbow = 3;              // of an arm
constexpr double kLate = 60.0;         // states, from one moment on [ms]
constexpr double kDrifts = 3.0;        // a zero of an elbow, until its angle is beyond its limit by [rad/s]
constexpr double kBeyond = 0.15;       // [rad]
constexpr float kFarAway = 30000.0f;   // [rad]
constexpr double kPersonAway = 6.0;    // [m]
constexpr double kPersonHeight = 1.7;  // [m]

GuardSetup setup_of_holds() {
  RobotConfig config;
  config.twin = true;
  config.permission.mode_machine = TwinOptions{}.mode_machine;
  return guard_setup(config, false);
}

// The twin's own faults: kind, how long, value. Those of the rest are made by HoldRun::trouble().
std::vector<TwinFault> faults_of(StopCause cause, double begin, double lasts) {
  switch (cause) {
    case StopCause::kStateAge:
      return {{TwinFaultKind::kDrop, begin, begin + kGap, 100.0}};
    case StopCause::kBadStates:
      return {{TwinFaultKind::kFlip, begin, begin + lasts, 20.0}};
    case StopCause::kRemoteAge:
      return {{TwinFaultKind::kRemoteLost, begin, begin + lasts, 0.0}};
    case StopCause::kDeadMan:
      return {{TwinFaultKind::kDeadMan, begin, begin + lasts, 0.0}};
    case StopCause::kMode:
      return {{TwinFaultKind::kMode, begin, begin + lasts, 0.0}};
    case StopCause::kCharge:
      return {{TwinFaultKind::kCharge, begin, begin + lasts, 15.0}};
    case StopCause::kTemperature:
      return {{TwinFaultKind::kHot, begin, begin + lasts, 125.0}};
    case StopCause::kTilt:
      return {{TwinFaultKind::kTilt, begin, begin + kShort, 0.6}};
    case StopCause::kStateDelay:
      return {{TwinFaultKind::kDelay, begin, begin + lasts, kLate}};
    default:
      return {};
  }
}

// One trial: a planner who walks and swings the arms, a person far ahead, an operator, and one trouble.
class HoldRun {
 public:
  HoldRun(StopCause cause, const HoldTrialSetup& setup, std::unique_ptr<Walker> walker, std::uint64_t seed)
      : cause_(cause),
        setup_(setup),
        begin_(kRunsBy + Random(seed, stream_key({"hold trial"})).uniform(0.0, kAnyStride)),
        robot_(load_shared_robot()),
        link_(setup_of_holds(), noisy_twin(setup.noise, setup.engine, seed), std::move(walker), nullptr,
              faults_of(cause, begin_, setup.seconds)) {
    plan_.command.q = robot_->neutral;
    plan_.command.root.height = HardwareLimits{}.height;
    for (int j = 0; j < person_.joints.cols(); ++j)
      person_.joints.col(j) = Eigen::Vector3d(kPersonAway, 0.0, kPersonHeight * j / (person_.joints.cols() - 1));
  }

  HoldTrial run() {
    while (time() < begin_ - kPlanPeriod) tick();
    if (state() != SafetyState::kRun)
      throw std::runtime_error(
          fmt::format("hold trial: expected a twin that runs by {:.1f} s, it is at {}", begin_, place()));
    link_.operated().asks(false);
    before_ = link_.twin().root().p;
    while (time() < begin_ + setup_.seconds && !result_.fell) {
      trouble();
      tick();
      note();
    }
    result_.held = reached_ && !result_.damped && state() == SafetyState::kHold;
    result_.said = place();
    if (!result_.fell) ask_again();
    return result_;
  }

 private:
  [[nodiscard]] double time() { return link_.twin().time(); }
  [[nodiscard]] const SafetyMemory& safety() const { return link_.guard().status().safety; }
  [[nodiscard]] SafetyState state() const { return safety().state; }
  [[nodiscard]] std::string place() const {
    return fmt::format("{} ({})", safety_state_name(state()), stop_cause_name(safety().cause));
  }

  void tick() {
    const bool lasts = time() >= begin_ && time() < begin_ + setup_.seconds;
    const double swing = kArmSwing * std::sin(2.0 * std::numbers::pi * 0.5 * time());
    for (const std::vector<int>& arm : robot_->roles.arms)
      plan_.command.q[arm[kElbow]] = robot_->neutral[arm[kElbow]] + swing;
    plan_.command.root.forward = setup_.forward;
    plan_.command.stamp = time();
    ++plan_.sequence;
    if (!(lasts && cause_ == StopCause::kPlannerAge)) link_.send(plan_);
    ++person_.sequence;
    if (!(lasts && cause_ == StopCause::kPersonAge)) link_.send(person_);
    link_.next(report_);
  }

  void trouble() {
    const bool glitch = time() < begin_ + kShort;
    TwinTrouble& trouble = link_.trouble;
    trouble.foreign_writers = cause_ == StopCause::kForeignWriter ? 1 : 0;
    trouble.odometry = cause_ != StopCause::kOdometryAge;
    if (cause_ == StopCause::kOdometryJump) trouble.jump = 0.2;
    link_.twin().condition.joint_speed = cause_ == StopCause::kJointSpeed && glitch ? 15.0 : 0.0;
    link_.twin().condition.gyro = cause_ == StopCause::kGyro && glitch ? 7.0 : 0.0;
    if (cause_ == StopCause::kLoopLate && !paused_) link_.pause(kGap);
    paused_ = true;
    const bool is_of_a_joint = cause_ >= StopCause::kJointJump && cause_ <= StopCause::kJointRange;
    if (is_of_a_joint)
      trouble.spoil = [this](LowStateFrame& frame) { spoil(frame.motor[robot_->roles.arms[0][kElbow]]); };
  }

  // The reading of an elbow.
  void spoil(MotorStateFrame& motor) {
    const bool lasts = time() < begin_ + setup_.seconds;
    if (lasts && cause_ == StopCause::kJointJump) motor.q = kFarAway;
    if (lasts && cause_ == StopCause::kJointMismatch) motor.dq = -motor.dq;
    if (lasts && cause_ == StopCause::kJointFrozen) {
      if (!frozen_) frozen_ = motor;
      motor.q = frozen_->q;
      motor.dq = frozen_->dq;
      motor.tau_est = frozen_->tau_est;
    }
    if (cause_ != StopCause::kJointRange) return;
    const double most = robot_->joints[robot_->roles.arms[0][kElbow]].upper + kBeyond - motor.q;
    const double before = drifted_;
    const double wanted = lasts ? most : 0.0;
    drifted_ += std::clamp(wanted - drifted_, -kDrifts * kTwinPeriod, kDrifts * kTwinPeriod);
    motor.q += static_cast<float>(drifted_);
    motor.dq += static_cast<float>((drifted_ - before) / kTwinPeriod);
  }

  void note() {
    const RobotState& body = link_.twin().physics()->state();
    result_.fell = has_fallen(body, robot_->fall);
    reached_ = reached_ || (state() == SafetyState::kHold && safety().cause == cause_);
    result_.damped = result_.damped || state() >= SafetyState::kDamp;
    const Eigen::Vector3d up = body.X_WB.R * Eigen::Vector3d::UnitZ();
    result_.tilt = std::max(result_.tilt, std::acos(std::clamp(up.z(), -1.0, 1.0)));
    result_.strayed = std::max(result_.strayed, (body.X_WB.p - before_).head<2>().norm());
  }

  void ask_again() {
    link_.trouble.foreign_writers = 0;
    link_.trouble.odometry = true;
    link_.operated().asks(true);
    for (const double end = time() + kAskedFor; time() < end && !result_.ran_again;) {
      tick();
      result_.ran_again = state() == SafetyState::kRun;
    }
  }

  StopCause cause_;
  HoldTrialSetup setup_;
  double begin_;
  std::shared_ptr<const RobotModel> robot_;
  TwinInProcess link_;
  PlannerMessage plan_;
  PersonMessage person_;
  GuardReport report_;
  Eigen::Vector3d before_ = Eigen::Vector3d::Zero();
  bool paused_ = false, reached_ = false;
  std::optional<MotorStateFrame> frozen_;  // of the elbow
  double drifted_ = 0.0;                   // its zero [rad]
  HoldTrial result_;
};

}  // namespace

const std::vector<StopCause>& causes_of_holds() {
  using C = StopCause;
  static const std::vector<StopCause> causes = {
      C::kPersonAge,   C::kDeadMan,       C::kRemoteAge, C::kPlannerAge,    C::kStateAge,   C::kBadStates,
      C::kOdometryAge, C::kOdometryJump,  C::kLoopLate,  C::kTilt,          C::kJointSpeed, C::kGyro,
      C::kTemperature, C::kCharge,        C::kMode,      C::kForeignWriter, C::kStateDelay, C::kJointJump,
      C::kJointFrozen, C::kJointMismatch, C::kJointRange};
  return causes;
}

HoldTrial run_hold_trial(StopCause cause, const HoldTrialSetup& setup, std::unique_ptr<Walker> walker,
                         std::uint64_t seed) {
  return HoldRun(cause, setup, std::move(walker), seed).run();
}

}  // namespace duet
