#include "duet/hardware/safety/limiter.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "duet/core/require.h"
#include "duet/hardware/safety/limits.h"

namespace duet {
namespace {

// How much nearer counts as nearer: far below any distance that is kept, far above rounding [m].
constexpr double kNearer = 1e-9;
constexpr double kTorqueRounding = 1e-9;  // of a target that leads by as much as it may [N m]
// Angle from the open pose at which an arm counts as open [rad].
constexpr double kOpen = 0.1;
// Share of the speed of a touch that arms keep however near somebody is who takes part in the act.
constexpr double kCreep = 0.25;

bool is_finite(const VelocityCommand& root) {
  return std::isfinite(root.forward) && std::isfinite(root.lateral) && std::isfinite(root.yaw_rate) &&
         std::isfinite(root.height);
}

const std::shared_ptr<const RobotModel>& checked_robot(const LimiterSetup& setup) {
  require(setup.robot != nullptr, "limiter: expected a robot, found none");
  require(setup.dt > 0.0 && std::isfinite(setup.dt), "limiter: expected a dt above 0 s, found {}", setup.dt);
  return setup.robot;
}

void check_executed(const ExecutedJoints& executed, const RobotModel& robot) {
  for (const int joint : executed.joints)
    require(joint >= 0 && joint < robot.dof(), "limiter: expected joints 0 to {}, found {}", robot.dof() - 1, joint);
  require(executed.kp.size() == robot.dof() && executed.kd.size() == robot.dof(),
          "limiter: expected gains of {} joints, found {} and {}", robot.dof(), executed.kp.size(), executed.kd.size());
  require(executed.kp.allFinite() && executed.kd.allFinite() && (executed.kp.array() >= 0.0).all() &&
              (executed.kd.array() >= 0.0).all(),
          "limiter: expected gains that are finite and not below 0, found others");
}

AxisBounds bounds_of_joint(const RobotJoint& joint, const HardwareLimits& limits) {
  const double speed = std::min(limits.arm_speed, joint.velocity);
  const double middle = 0.5 * (joint.lower + joint.upper);
  return {std::min(joint.lower + limits.joint_margin, middle), std::max(joint.upper - limits.joint_margin, middle),
          speed, speed, limits.arm_acceleration};
}

void count_if(bool clamped, ClampCounts& counts, ClampReason reason) {
  if (clamped) count(counts, reason);
}

// One direction of the root; its speed is a share of what is allowed.
void move_speed(double target, double share, const AxisBounds& bounds, double dt, AxisState& axis,
                ClampCounts& counts) {
  AxisClamps clamps;
  const double inside = std::clamp(target, bounds.lower, bounds.upper);
  axis = follow(share * inside, axis, bounds, dt, clamps);
  count_if(inside != target, counts, ClampReason::kRootSpeed);
  count_if(clamps.rate, counts, ClampReason::kRootAcceleration);
  count_if(clamps.rate_change, counts, ClampReason::kRootJerk);
}

}  // namespace

Limiter::Limiter(const LimiterSetup& setup)
    : setup_(setup),
      distance_(checked_robot(setup), setup.person ? setup.human : HumanBody{},
                setup.person ? setup.touches : std::vector<TouchPair>{}) {
  const HardwareLimits& limits = setup_.limits;
  check_executed(setup_.executed, *setup_.robot);
  require(!setup_.person || !setup_.human.capsules.empty(), "limiter: expected the body of the person, found none");
  forward_ = {-limits.backward, limits.forward, limits.acceleration, limits.stop_acceleration, limits.jerk};
  lateral_ = {-limits.lateral, limits.lateral, limits.acceleration, limits.stop_acceleration, limits.jerk};
  yaw_ = {-limits.yaw_rate, limits.yaw_rate, limits.yaw_acceleration, limits.yaw_acceleration, limits.jerk};
  height_ = {limits.height - limits.height_range, limits.height + limits.height_range, limits.height_rate,
             limits.height_rate, limits.acceleration};
  for (const RobotJoint& joint : setup_.robot->joints) joint_bounds_.push_back(bounds_of_joint(joint, limits));
  executed_.assign(setup_.robot->joints.size(), false);
  for (const int joint : setup_.executed.joints) executed_[joint] = true;
  for (const HumanCapsule& capsule : distance_.human().capsules)
    touch_speeds_.push_back(touch_speed(setup_.contact_limits.region(capsule.region), limits.arm_mass));
  arm_speed_ = limits.arm_speed * limits.arm_reach;
  if (!touch_speeds_.empty()) creep_speed_ = kCreep * *std::ranges::min_element(touch_speeds_);
  approach_speed_ = std::hypot(limits.forward, limits.lateral) + arm_speed_;
  wanted_.q.setZero(setup_.robot->dof());
  q_rest_.setZero(setup_.robot->dof());
  before_.resize(setup_.robot->joints.size());
  joint_clamps_.assign(setup_.robot->joints.size(), 0);
}

LimiterState Limiter::start(const RobotState& measured) const {
  require(measured.q.size() == setup_.robot->dof() && measured.q.allFinite(),
          "limiter: expected {} finite joint angles to start from, found others", setup_.robot->dof());
  LimiterState state;
  state.height.value = setup_.limits.height;
  for (const double q : measured.q) state.joints.push_back({q, 0.0});
  state.good.q = measured.q;
  return state;
}

void Limiter::restart(const Eigen::VectorXd& q, LimiterState& state) const {
  state.forward = state.lateral = state.yaw = {};
  state.height = {setup_.limits.height, 0.0};
  for (int joint = 0; joint < setup_.robot->dof(); ++joint) state.joints[joint] = {q[joint], 0.0};
  state.good.root = {0.0, 0.0, 0.0, setup_.limits.height};
  state.good.q = q;
}

void Limiter::tick(const MotionCommand* received, const LimiterInput& input, LimiterState& state, LimitedCommand& out,
                   ClampCounts& counts) {
  std::ranges::fill(joint_clamps_, 0);
  admit(received, state, counts);
  choose(input, state, counts);
  before_ = state.joints;
  const BodyGaps gaps = gaps_at_rest(input, before_);
  if (input.release) open_arms(input, counts);
  keep_distance(input, gaps, counts);
  keep_inside(input, gaps, counts);
  move_root(state, counts);
  move_joints(input, state, counts);
  avoid_bodies(input, before_, gaps, state, counts);
  if (setup_.executed.fixed_gains) give_way(input, state, counts);
  write(input, state, out, counts);
}

void Limiter::count_joint_if(bool clamped, int joint, ClampReason reason, ClampCounts& counts) {
  if (!clamped) return;
  count(counts, reason);
  joint_clamps_[joint] |= std::uint32_t{1} << static_cast<unsigned>(reason);
}

std::optional<ClampReason> Limiter::refusal(const MotionCommand& command, const LimiterState& state) const {
  if (command.q.size() != setup_.robot->dof()) return ClampReason::kSize;
  if (!std::isfinite(command.stamp) || !is_finite(command.root) || !command.q.allFinite())
    return ClampReason::kNotFinite;
  if (state.has_good && command.stamp <= state.good.stamp) return ClampReason::kStamp;
  return std::nullopt;
}

// A command with one bad number is no command: the last good one stands.
void Limiter::admit(const MotionCommand* received, LimiterState& state, ClampCounts& counts) const {
  if (received == nullptr) return;
  if (const std::optional<ClampReason> refused = refusal(*received, state)) return count(counts, *refused);
  state.good = *received;
  state.has_good = true;
}

void Limiter::choose(const LimiterInput& input, const LimiterState& state, ClampCounts& counts) {
  wanted_.root = state.has_good ? state.good.root : VelocityCommand{0.0, 0.0, 0.0, state.height.value};
  wanted_.q = state.good.q;
  wanted_.share_all(std::isfinite(input.share) ? std::clamp(input.share, 0.0, 1.0) : 0.0);
  count_if(wanted_.share < 1.0, counts, ClampReason::kHold);
}

void Limiter::open_arms(const LimiterInput& input, ClampCounts& counts) {
  const Eigen::VectorXd& open = setup_.robot->neutral;
  wanted_.q = open;
  wanted_.share_all(1.0);
  bool arms_are_open = true;
  for (const int joint : setup_.executed.joints)
    arms_are_open = arms_are_open && std::abs(input.state.q[joint] - open[joint]) < kOpen;
  wanted_.root.forward = arms_are_open ? -setup_.limits.step_back : 0.0;
  if (!(input.share > 0.0)) wanted_.root.forward = 0.0;
  wanted_.root.lateral = 0.0;
  wanted_.root.yaw_rate = 0.0;
  count(counts, ClampReason::kRelease);
}

double Limiter::allowed_speed(double distance, double person_speed) const {
  const HardwareLimits& limits = setup_.limits;
  const double left = distance - person_speed * (limits.reaction_time + limits.stopping_time) - limits.reserve;
  return std::max(left, 0.0) / (limits.reaction_time + 0.5 * limits.stopping_time);
}

// While the act lasts the person is known to want the touch: the parts that may not touch then keep the distance of the
// speed that is measured, not of the one that is assumed. Arms that are too near for that creep: whoever is held in
// them has to get out.
void Limiter::keep_distance(const LimiterInput& input, const BodyGaps& gaps, ClampCounts& counts) {
  if (!setup_.person || input.release) return;
  if (input.person == nullptr || !input.odometry) {
    wanted_.share_all(0.0);
    return count(counts, ClampReason::kPartnerUnknown);
  }
  const double measured = std::max(input.person_speed, 0.0);
  const double assumed = input.acting ? measured : std::max(measured, setup_.limits.human_speed);
  double speed = allowed_speed(gaps.person, assumed);
  count_if(speed < wanted_.share * approach_speed_, counts, ClampReason::kSeparation);
  if (gaps.touched >= 0 && allowed_speed(gaps.touch, measured) < approach_speed_) {
    const double touch = touch_speeds_[gaps.touched];
    count_if(touch < std::min(speed, wanted_.share * approach_speed_), counts, ClampReason::kTouchSpeed);
    speed = std::min(speed, touch);
  }
  share_out(speed);
  if (input.acting) wanted_.arm_share = std::max(wanted_.arm_share, std::min(input.share, creep_speed_ / arm_speed_));
}

// A gait has a smallest speed: the root goes as it is asked to, or stands where that is too fast, and the arms have
// what it leaves. A turn moves the hands, too.
void Limiter::share_out(double speed) {
  if (speed >= wanted_.share * approach_speed_) return;
  const VelocityCommand& root = wanted_.root;
  const double walk = std::hypot(std::clamp(root.forward, forward_.lower, forward_.upper),
                                 std::clamp(root.lateral, lateral_.lower, lateral_.upper)) +
                      std::clamp(std::abs(root.yaw_rate), 0.0, yaw_.upper) * setup_.limits.arm_reach;
  const double walks = wanted_.share * walk;
  const bool stands = walks > speed;
  wanted_.share = speed / approach_speed_;
  if (stands) wanted_.root_share = 0.0;
  wanted_.arm_share = std::min(wanted_.arm_share, (stands ? speed : speed - walks) / arm_speed_);
}

// The root neither leaves the box nor comes nearer to a head: what of the velocity leads there is taken away.
void Limiter::keep_inside(const LimiterInput& input, const BodyGaps& gaps, ClampCounts& counts) {
  VelocityCommand& root = wanted_.root;
  if (!input.odometry) {
    count_if(root.forward != 0.0 || root.lateral != 0.0, counts, ClampReason::kNoOdometry);
    root.forward = root.lateral = 0.0;
    return;
  }
  const HardwareLimits& limits = setup_.limits;
  const double reserve = limits.forward * (limits.reaction_time + limits.stopping_time);
  const Eigen::Rotation2Dd R_WH(yaw_of(input.state.X_WB.R));
  const Eigen::Vector2d asked_W = R_WH * Eigen::Vector2d(root.forward, root.lateral);
  Eigen::Vector2d v_W = asked_W;
  const Eigen::Vector2d fence(limits.fence_x, limits.fence_y);
  for (int axis = 0; axis < 2; ++axis) {
    const double place = input.state.X_WB.p[axis];
    if (std::abs(place) < fence[axis] - reserve || place * v_W[axis] <= 0.0) continue;
    count(counts, ClampReason::kFence);
    v_W[axis] = 0.0;
  }
  const Eigen::Vector2d to_head = gaps.head_from_robot.head<2>().normalized();
  if (gaps.head < limits.head_distance + reserve && v_W.dot(to_head) > 0.0) {
    count(counts, ClampReason::kHeadDistance);
    v_W -= to_head * v_W.dot(to_head);
  }
  if (v_W == asked_W) return;
  const Eigen::Vector2d v_H = R_WH.inverse() * v_W;
  root.forward = v_H.x();
  root.lateral = v_H.y();
}

void Limiter::move_root(LimiterState& state, ClampCounts& counts) const {
  const double dt = setup_.dt;
  move_speed(wanted_.root.forward, wanted_.root_share, forward_, dt, state.forward, counts);
  move_speed(wanted_.root.lateral, wanted_.root_share, lateral_, dt, state.lateral, counts);
  move_speed(wanted_.root.yaw_rate, wanted_.root_share, yaw_, dt, state.yaw, counts);
  AxisClamps clamps;
  AxisBounds height = height_;
  height.rate *= wanted_.share;
  height.stop_rate = height.rate;
  state.height = follow(wanted_.root.height, state.height, height, dt, clamps);
  count_if(clamps.value || clamps.rate || clamps.rate_change, counts, ClampReason::kHeight);
}

// The angle nearest to `target` from which the gains ask for no more than their share of the joint's effort.
double Limiter::within_torque(int joint, const LimiterInput& input, double target) const {
  const double kp = setup_.executed.kp[joint];
  if (kp <= 0.0) return target;
  const double most = setup_.limits.torque_share * setup_.robot->joints[joint].effort;
  const double damping = setup_.executed.kd[joint] * input.state.v[joint];
  const double q = input.state.q[joint];
  return std::clamp(target, q + (damping - most) / kp, q + (damping + most) / kp);
}

double Limiter::lead_target(int joint, const LimiterInput& input, ClampCounts& counts) {
  const double target = within_torque(joint, input, wanted_.q[joint]);
  count_joint_if(target != wanted_.q[joint], joint, ClampReason::kJointLead, counts);
  return target;
}

// An arm that is pushed away faster than its target may follow is followed all the same where the gains cannot fall.
void Limiter::give_way(const LimiterInput& input, LimiterState& state, ClampCounts& counts) {
  for (const int joint : setup_.executed.joints) {
    const double given = within_torque(joint, input, state.joints[joint].value);
    if (std::abs(given - state.joints[joint].value) <= kNearer) continue;
    state.joints[joint] = {std::clamp(given, joint_bounds_[joint].lower, joint_bounds_[joint].upper), 0.0};
    count_joint_if(true, joint, ClampReason::kJointTorque, counts);
  }
}

void Limiter::move_joints(const LimiterInput& input, LimiterState& state, ClampCounts& counts) {
  for (int joint = 0; joint < setup_.robot->dof(); ++joint) {
    if (!executed_[joint]) {
      state.joints[joint] = {input.state.q[joint], 0.0};
      continue;
    }
    AxisBounds bounds = joint_bounds_[joint];
    bounds.rate *= wanted_.arm_share;
    bounds.stop_rate = bounds.rate;
    AxisClamps clamps;
    state.joints[joint] = follow(lead_target(joint, input, counts), before_[joint], bounds, setup_.dt, clamps);
    count_joint_if(clamps.value, joint, ClampReason::kJointLimit, counts);
    count_joint_if(clamps.rate, joint, ClampReason::kJointSpeed, counts);
    count_joint_if(clamps.rate_change, joint, ClampReason::kJointAcceleration, counts);
  }
}

const BodyGaps& Limiter::gaps_at_rest(const LimiterInput& input, const std::vector<AxisState>& joints) {
  for (int joint = 0; joint < setup_.robot->dof(); ++joint)
    q_rest_[joint] =
        executed_[joint] ? rest_value(joints[joint], joint_bounds_[joint], setup_.dt) : input.state.q[joint];
  const HumanJoints* person = setup_.person && input.odometry ? input.person : nullptr;
  return distance_.measure(input.state.X_WB, q_rest_, person, setup_.limits.pose_uncertainty, input.acting);
}

// A step after which the arms could no longer come to rest in time is not made: one brakes instead, where that is
// enough, so that an arm which rests on its own body leaves the other free; otherwise both, which the step before left
// room for.
void Limiter::avoid_bodies(const LimiterInput& input, const std::vector<AxisState>& before, const BodyGaps& gaps,
                           LimiterState& state, ClampCounts& counts) {
  const auto nearness = [&] {
    const BodyGaps& next = gaps_at_rest(input, state.joints);
    const bool self = next.self < setup_.limits.self_distance && next.self < gaps.self - kNearer;
    const bool head = next.head < setup_.limits.head_distance && next.head < gaps.head - kNearer;
    return std::pair(self, head);
  };
  const auto [self, head] = nearness();
  count_if(self, counts, ClampReason::kSelfCollision);
  count_if(head, counts, ClampReason::kHeadDistance);
  if (!self && !head) return;
  std::vector<AxisState>& braked = before_;  // of which `before` is nothing more from here on
  for (const int joint : setup_.executed.joints) braked[joint] = brake(before[joint], joint_bounds_[joint], setup_.dt);
  for (const std::vector<int>& arm : setup_.robot->roles.arms) {
    const auto swap_arm = [&] {
      for (const int joint : arm)
        if (executed_[joint]) std::swap(state.joints[joint], braked[joint]);
    };
    swap_arm();
    if (nearness() == std::pair(false, false)) return;
    swap_arm();
  }
  for (const int joint : setup_.executed.joints) state.joints[joint] = braked[joint];
}

void Limiter::write(const LimiterInput& input, const LimiterState& state, LimitedCommand& out, ClampCounts& counts) {
  const int dof = setup_.robot->dof();
  out.root = {state.forward.value, state.lateral.value, state.yaw.value, state.height.value};
  out.q = input.state.q;
  out.kp.setZero(dof);
  out.kd.setZero(dof);
  for (const int joint : setup_.executed.joints) {
    out.q[joint] = state.joints[joint].value;
    const double kp = setup_.executed.kp[joint], kd = setup_.executed.kd[joint];
    const double most = setup_.limits.torque_share * setup_.robot->joints[joint].effort;
    const double asked = std::abs(kp * (out.q[joint] - input.state.q[joint]) - kd * input.state.v[joint]);
    const bool lowers = !setup_.executed.fixed_gains && asked > most + kTorqueRounding;
    const double gain = lowers ? most / asked : 1.0;
    count_joint_if(gain < 1.0, joint, ClampReason::kJointTorque, counts);
    out.kp[joint] = gain * kp;
    out.kd[joint] = gain * kd;
  }
}

}  // namespace duet
