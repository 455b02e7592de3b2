#include "duet/hardware/guard/robot_guard.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "duet/core/require.h"

namespace duet {
namespace {

// Keys of the remote control.
constexpr RemoteKey kDeadMan = RemoteKey::kR1, kStandUp = RemoteKey::kStart, kRun = RemoteKey::kA;
// Looking for other writers takes longer than a tick should: ten times a second, as what the feet carry is weighed.
constexpr double kWritersPeriod = 0.1;
constexpr double kWeighShare = 0.2;  // of the newest weighing in what counts: half a second of a gait
// Share of their stiffness that joints begin with, above 0: no stiffness is damping.
constexpr double kFirstGains = 0.1;
// Angle from the stance at which the robot counts as standing [rad].
constexpr double kStanding = 0.05;
constexpr double kWalkerPeriod = 0.02;  // [s]
constexpr double kStatePeriod = 0.002;  // of the robot [s]
constexpr long kTicksToNewWriter = 50;
// Faster than anybody moves a joint of theirs: a jump of the estimate [m/s].
constexpr double kPersonJump = 10.0;
// Speeds that hold: of an arm's joint, and shares of the card's limit. A step of HOMIE's takes ankle and knee to 13
// rad/s, one of WBC-Sim's an ankle to 15.
constexpr double kArmSpeed = 10.0;    // [rad/s]
constexpr double kAnkleShare = 0.5;   // 18.5 rad/s of the G1's
constexpr double kJointShare = 0.75;  // 15 rad/s of its knees, 24 of its hips
constexpr int kFirstAnkle = 4;        // the first of the two in a leg

ContactWatch contact_watch(const LimiterSetup& setup) {
  const double force = setup.person ? least_touch_force(setup.touches, setup.contact_limits) : 0.0;
  return {setup.robot, setup.limits, force, setup.dt};
}

const GuardSetup& checked(const GuardSetup& setup) {
  require(setup.limiter.robot != nullptr, "guard: expected a robot, found none");
  require(setup.limiter.robot->dof() == kG1Motors, "guard: expected a robot of {} joints, found {}", kG1Motors,
          setup.limiter.robot->dof());
  for (const Eigen::VectorXd* values : {&setup.stance.q_target, &setup.stance.kp, &setup.stance.kd})
    require(values->size() == kG1Motors && values->allFinite(),
            "guard: expected a stance of {} finite targets and gains, found another", kG1Motors);
  require(setup.gain_ramp >= 0.0 && std::isfinite(setup.gain_ramp),
          "guard: expected a gain_ramp of at least 0 s, found {}", setup.gain_ramp);
  return setup;
}

Eigen::VectorXd speed_limits(const RobotModel& robot) {
  Eigen::VectorXd limits(robot.dof());
  for (int j = 0; j < robot.dof(); ++j) limits[j] = kJointShare * robot.joints[j].velocity;
  for (const std::vector<int>& leg : robot.roles.legs)
    for (std::size_t k = kFirstAnkle; k < leg.size(); ++k) limits[leg[k]] = kAnkleShare * robot.joints[leg[k]].velocity;
  for (const std::vector<int>& arm : robot.roles.arms)
    for (const int j : arm) limits[j] = std::min(kArmSpeed, robot.joints[j].velocity);
  return limits;
}

// The bounds of the way to the stance: those of an arm, from wherever the joint is.
AxisBounds stance_bounds(const Limiter& limiter, int joint) {
  AxisBounds bounds = limiter.joint_bounds(joint);
  const RobotJoint& limits = limiter.setup().robot->joints[joint];
  bounds.lower = limits.lower;
  bounds.upper = limits.upper;
  return bounds;
}

}  // namespace

RobotGuard::RobotGuard(const GuardSetup& setup, FrameTransport& transport, VelocitySink& velocity)
    : setup_(checked(setup)),
      transport_(transport),
      velocity_(velocity),
      limiter_(setup_.limiter),
      contact_(contact_watch(setup_.limiter)),
      feet_(setup_.limiter.robot),
      speed_limits_(speed_limits(*setup_.limiter.robot)),
      watch_(*setup_.limiter.robot, speed_limits_) {
  setup_.rules.person_present = setup_.limiter.person;
  setup_.stance.tau_ff.setZero(kG1Motors);
  limiter_state_ = limiter_.start(setup_.limiter.robot->standing_state());
  input_.state = measured_ = setup_.limiter.robot->standing_state();
  joints_ = setup_.stance;
  stance_.resize(kG1Motors);
  planner_.command.q.setZero(kG1Motors);
  status_.limited.q.setZero(kG1Motors);
  status_.limited.kp = status_.limited.kd = status_.restart_q = status_.limited.q;
  next_.period = setup_.limiter.dt;
  speed_shares_.fill(Eigen::VectorXd::Zero(kG1Motors));
}

void RobotGuard::receive(const PlannerMessage& message, double now) {
  if (message.command.q.size() != kG1Motors) {
    count(status_.clamps, ClampReason::kSize);
    return;
  }
  const bool taken = planner_order_.takes(message.sequence, now);
  count_streams();
  if (!taken) return;
  // A command that the limiter refuses does not keep the planner alive: the last good command grows old.
  if (!limiter_.refusal(message.command, limiter_state_)) next_.planner_at = now;
  planner_ = message;
  planner_is_new_ = true;
}

// A pose that is not finite, or in which somebody jumped, is dropped: the one before grows old.
void RobotGuard::receive(const PersonMessage& message, double now) {
  const bool first = next_.person_at == kNever;
  const double exposed_at = now - message.latency;
  const double passed = std::max(exposed_at - next_.person_at, setup_.limiter.dt);
  const double moved = first ? 0.0 : (message.joints - person_.joints).colwise().norm().maxCoeff();
  const bool finite = message.joints.allFinite() && message.latency >= 0.0 && std::isfinite(message.latency);
  if (!finite || moved > 0.1 + kPersonJump * passed) {
    ++status_.bad_messages;
    return note_estimate(finite ? PersonFault::kJump : PersonFault::kFinite);
  }
  const bool taken = person_order_.takes(message.sequence, now) && (first || exposed_at > next_.person_at);
  count_streams();
  note_estimate(taken ? PersonFault::kNone : PersonFault::kOld);
  if (!taken) return;
  person_ = message;
  track_.add(message.joints, exposed_at, now);
  next_.person_at = exposed_at;
  count_streams();
}

void RobotGuard::receive(const OdometrySample& sample) {
  const bool finite = sample.X_WB.p.allFinite() && sample.v_WB.allFinite() && sample.X_WB.R.coeffs().allFinite();
  if (!sample.valid || !finite) return;
  if (odometry_.valid) {
    const double step = (sample.X_WB.p - odometry_.X_WB.p).head<2>().norm();
    next_.odometry_step = std::max(next_.odometry_step, step);
  }
  odometry_ = sample;
  next_.odometry_at = sample.at;
  count_streams();
}

void RobotGuard::count_streams() {
  status_.old_messages = planner_order_.old() + person_order_.old();
  status_.restarts =
      planner_order_.restarts() + person_order_.restarts() + person_.sender_restarts + odometry_.sender_restarts;
}

void RobotGuard::receive(const BatteryReading& battery, double now) {
  battery_ = battery;
  battery_at_ = now;
}

void RobotGuard::arm() { armed_ = !setup_.dry_run; }

void RobotGuard::tick(double now) {
  next_.now = now;
  read_states(now);
  read_operator(now);
  check_robot();
  next_.arm = armed_;
  next_.written_at = now - setup_.limiter.dt * static_cast<double>(unsent_);  // a pause of ours is none of the writer
  safety_ = next_safety(setup_.rules, safety_, next_);
  armed_ = false;
  status_.order = safety_order(setup_.rules, safety_, next_);
  status_.input = next_;
  command(now);
  send();
  status_.safety = safety_;
  ++status_.ticks;
  next_.odometry_step = 0.0;
}

void RobotGuard::read_states(double now) {
  next_.bad_states = 0;
  status_.took_state = false;
  bool came = false;
  while (transport_.take(status_.state_frame)) {
    status_.took_state = true;
    switch (read_state(status_.state_frame, reading_)) {
      case FrameFault::kNone:
        ++status_.states;
        came = true;
        next_.state_at = now;
        watch_speeds();
        watch_joints();
        continue;
      case FrameFault::kRepeated:
        continue;
      case FrameFault::kChecksum:
        ++status_.checksum_faults;
        break;
      case FrameFault::kTick:
        ++status_.tick_faults;
        break;
      case FrameFault::kNotFinite:
        ++status_.number_faults;
        break;
    }
    ++next_.bad_states;
  }
  if (came && has_own_clock_) delay_.see(reading_.tick, now);
  next_.state_delay = delay_.steady();
}

// A single sample is no speed: encoders are noisy, and a foot that lands shakes its ankle for a moment.
void RobotGuard::watch_speeds() {
  std::swap(speed_shares_[2], speed_shares_[1]);
  std::swap(speed_shares_[1], speed_shares_[0]);
  speed_shares_[0] = reading_.state.v.cwiseAbs().cwiseQuotient(speed_limits_);
  reading_.health.joint_speed_share = speed_shares_[0].cwiseMin(speed_shares_[1]).cwiseMin(speed_shares_[2]).maxCoeff();
}

// The angle of a joint that jumped is not believed: where it was before stands in for it, for whoever walks or limits.
// Where not even the gyro changes by a bit, the robot is a twin without noise: joints that stand still are as they are.
void RobotGuard::watch_joints() {
  RobotState& state = reading_.state;
  const double dt = kStatePeriod * count_.periods_to(reading_.tick);
  const bool is_quiet = state.w_WB_B == measured_.w_WB_B;
  watch_.see(state.q, state.v, reading_.tau, dt, !safety_.commands || is_quiet);
  reading_.health.joints = watch_.doubts();
  for (int j = 0; j < kG1Motors; ++j) {
    if (!watch_.jumped(j)) continue;
    state.q[j] = watch_.before_jump(j);
    state.v[j] = 0.0;
  }
}

// Reads the remote control, which counts only while states arrive that carry it.
void RobotGuard::read_operator(double now) {
  const bool fresh = next_.state_at == now && reading_.remote.heard;
  if (fresh) next_.remote_at = now;
  if (fresh && reading_.remote.holds(kDeadMan)) next_.dead_man_at = now;
  next_.stop_key = stop_asked_ || (fresh && reading_.remote.asks_to_stop());
  stop_asked_ = false;
  next_.stand = fresh && reading_.remote.holds(kStandUp);
  next_.run = fresh && reading_.remote.holds(kRun);
}

void RobotGuard::check_robot() {
  next_.health = reading_.health;
  if (setup_.has_battery)
    next_.health.charge =
        next_.now - battery_at_ <= kBatteryAge ? battery_.charge : std::numeric_limits<double>::quiet_NaN();
  next_.health.mode_is_expected =
      !reading_.any || (reading_.mode_pr == kPitchRollMode && reading_.mode_machine == setup_.mode_machine);
  if (ticks_to_writers_-- <= 0) {
    ticks_to_writers_ = static_cast<int>(kWritersPeriod / setup_.limiter.dt);
    next_.foreign_writer = transport_.foreign_writers() > 0;
    weigh();
  }
  next_.health.carried = carried_;
}

// The load of the feet now, with the torques of gravity in the tick before.
void RobotGuard::weigh() {
  if (!reading_.any) return;
  const double now = feet_.carried(reading_.state, contact_.weight(), reading_.tau);
  carried_ = std::isnan(carried_) ? now : carried_ + kWeighShare * (now - carried_);
}

// Every joint to its stance, from where it was measured when the robot was told to stand, as fast as the distance to a
// person allows. It stands once all are there with their full gains, and none would stop faster than it may.
void RobotGuard::follow_stance() {
  if (!follows_stance_)
    for (int j = 0; j < kG1Motors; ++j) stance_[j] = {reading_.state.q[j], 0.0};
  raise_gains();
  follows_stance_ = true;
  AxisClamps clamps;
  next_.stands = gains_ >= 1.0;
  for (int j = 0; j < kG1Motors; ++j) {
    const double target = setup_.stance.q_target[j];
    AxisBounds bounds = stance_bounds(limiter_, j);
    const double stop = bounds.rate_change * setup_.limiter.dt;
    bounds.rate *= limiter_.share();
    bounds.stop_rate = bounds.rate;
    stance_[j] = follow(target, stance_[j], bounds, setup_.limiter.dt, clamps);
    const bool there = std::abs(stance_[j].value - target) < kStanding && std::abs(stance_[j].rate) <= stop;
    next_.stands = next_.stands && there;
    joints_.q_target[j] = stance_[j].value;
  }
  joints_.kp = gains_ * setup_.stance.kp;
  joints_.kd = setup_.stance.kd;
  joints_.tau_ff.setZero();
}

// Joints that were damped get their stiffness by and by; their damping at once.
void RobotGuard::raise_gains() {
  if (!follows_stance_)
    gains_ = setup_.gain_ramp > 0.0 ? kFirstGains : 1.0;
  else
    gains_ = std::min(gains_ + (1.0 - kFirstGains) * setup_.limiter.dt / setup_.gain_ramp, 1.0);
}

// The arms' weight, as far as it and the gains together ask for no more than the share of a joint's effort that the
// limits leave; nothing where the pose is not measured now.
void RobotGuard::carry_arms(double now) {
  const bool is_measured = level_of(now - next_.state_at, setup_.rules.state) < StopLevel::kHold;
  for (const int joint : setup_.limiter.executed.joints) {
    const double most = setup_.limiter.limits.torque_share * setup_.limiter.robot->joints[joint].effort;
    const double by_gains = joints_.kp[joint] * (joints_.q_target[joint] - reading_.state.q[joint]) -
                            joints_.kd[joint] * reading_.state.v[joint];
    const double weight = is_measured ? gains_ * contact_.weight()[6 + joint] : 0.0;
    joints_.tau_ff[joint] = std::clamp(weight, std::min(-most - by_gains, 0.0), std::max(most - by_gains, 0.0));
  }
}

void RobotGuard::command(double now) {
  status_.contact = contact_.update(reading_.state, reading_.tau);
  input_.state.q = reading_.state.q;
  input_.state.v = reading_.state.v;
  input_.state.w_WB_B = reading_.state.w_WB_B;
  input_.state.X_WB = {odometry_.X_WB.R, odometry_.X_WB.p};
  input_.state.v_WB = odometry_.v_WB;
  measured_ = input_.state;
  const Eigen::Quaterniond& tilted = reading_.state.X_WB.R;
  measured_.X_WB.R = yaw_rotation(yaw_of(odometry_.X_WB.R) - yaw_of(tilted)) * tilted;
  input_.odometry = level_of(now - next_.odometry_at, setup_.rules.odometry) < StopLevel::kHold;
  const bool person = level_of(now - next_.person_at, setup_.rules.person) < StopLevel::kHold;
  input_.person = person ? &person_.joints : nullptr;
  input_.person_speed = track_.speed();
  const bool holds = safety_.state == SafetyState::kHold;
  const bool planned = safety_.state == SafetyState::kRun || (holds && next_.stands);
  const double apart = (person_.joints.col(0) - odometry_.X_WB.p).head<2>().norm();
  engagement_.update(planned && planner_.acting && person, apart, input_.person_speed, now);
  input_.acting = engagement_.engaged();
  input_.share = status_.order.share;
  input_.release = planned && status_.contact.release;
  restart_limiter(planned);
  status_.received = planner_is_new_;
  const MotionCommand* received = planner_is_new_ ? &planner_.command : nullptr;
  limiter_.tick(received, input_, limiter_state_, status_.limited, status_.clamps);
  planner_is_new_ = false;
  status_.share = limiter_.share();
  if (status_.order.damps || !status_.order.writes) follows_stance_ = next_.stands = false;
  if (status_.order.stands || (holds && !planned)) follow_stance();
  walk(planned);
  if (planned) {
    for (const int joint : setup_.limiter.executed.joints) {
      joints_.q_target[joint] = status_.limited.q[joint];
      joints_.kp[joint] = status_.limited.kp[joint];
      joints_.kd[joint] = status_.limited.kd[joint];
    }
  }
  if (setup_.arm_gravity) carry_arms(now);
}

// Runs from when it stands until it is damped, a hold included, 50 times a second; the velocity has passed the limiter.
void RobotGuard::walk(bool planned) {
  const bool was_walking = walks_;
  walks_ = walker_ != nullptr && (planned || (status_.order.stands && next_.stands));
  if (!walks_) return;
  if (!was_walking) {
    walker_->begin(measured_);
    ticks_to_step_ = 0;
  }
  if (ticks_to_step_-- > 0) return keep_walking();
  ticks_to_step_ = static_cast<int>(std::lround(kWalkerPeriod / setup_.limiter.dt)) - 1;
  const VelocityCommand stand{0.0, 0.0, 0.0, setup_.limiter.limits.height};
  walker_joints_ = &walker_->update(measured_, planned ? status_.limited.root : stand, joints_.q_target);
  keep_walking();
}

// The stance is written anew every tick: what the walker said last stands.
void RobotGuard::keep_walking() {
  for (int joint = 0; joint < kG1Motors; ++joint) {
    if (limiter_.executes(joint)) continue;
    joints_.q_target[joint] = walker_joints_->q_target[joint];
    joints_.kp[joint] = walker_joints_->kp[joint];
    joints_.kd[joint] = walker_joints_->kd[joint];
    joints_.tau_ff[joint] = walker_joints_->tau_ff[joint];
  }
}

// Planned motion begins where the stance was sent; before it, the limiter only watches.
void RobotGuard::restart_limiter(bool planned) {
  status_.restarted = !planned || !was_planned_;
  was_planned_ = planned;
  if (!status_.restarted) return;
  status_.restart_q = planned ? joints_.q_target : reading_.state.q;
  limiter_.restart(status_.restart_q, limiter_state_);
}

void RobotGuard::send() {
  status_.sent = false;
  velocity_.enter(safety_.state);
  const SafetyOrder& order = status_.order;
  if (!order.writes || setup_.dry_run) {
    unsent_ = 0;
    watch_.sent_none();
    if (transport_.has_writer()) transport_.close_writer();
    return;
  }
  if (!transport_.has_writer()) transport_.open_writer();
  const auto machine = static_cast<std::uint8_t>(setup_.mode_machine);
  if (order.damps) {
    build_damping(kDampingGain, machine, status_.frame);
    watch_.sent_none();
  } else {
    build_command(joints_, machine, status_.frame);
    watch_.sent(joints_.q_target);
  }
  status_.sent = transport_.write(status_.frame);
  keep_writer();
  velocity_.send(was_planned_ ? status_.limited.root : VelocityCommand{0.0, 0.0, 0.0, setup_.limiter.limits.height});
}

// A writer that is lost is made anew now and then: nothing else commands the robot.
void RobotGuard::keep_writer() {
  unsent_ = status_.sent ? 0 : unsent_ + 1;
  if (unsent_ > 0 && unsent_ % kTicksToNewWriter == 0) transport_.close_writer();
}

}  // namespace duet
