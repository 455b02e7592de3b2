#include "duet/training/wbc_environment.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "duet/backends/engine_module.h"
#include "duet/core/robot_state.h"
#include "duet/policies/policy.h"
#include "duet/rollout/world.h"
#include "duet/training/wbc_task.h"

namespace duet {
namespace {

constexpr double kHigher = 0.05, kSlacker = 0.1;             // than the card's fall, where an episode ends [m], cosine
constexpr double kCaptureMargin = 1.2, kFarthestStep = 0.4;  // share, [m]

double kernel(double error, double width) { return std::exp(-error * error / (width * width)); }

double angle_between(const Eigen::Matrix3d& A, const Eigen::Matrix3d& B) {
  return std::acos(std::clamp(0.5 * ((A.transpose() * B).trace() - 1.0), -1.0, 1.0));
}

}  // namespace

void TrackingStatistics::add(const TrackingStatistics& other) {
  ticks += other.ticks;
  root_xy += other.root_xy;
  heading += other.heading;
  upper_body += other.upper_body;
  joints += other.joints;
  action_rate += other.action_rate;
  clock += other.clock;
  swing_lift += other.swing_lift;
  stepping_ticks += other.stepping_ticks;
  swings += other.swings;
}

WbcEnvironment::WbcEnvironment(std::shared_ptr<const RobotModel> robot, const WbcTask& task, std::uint64_t seed,
                               int index)
    : nominal_(std::move(robot)),
      task_(task),
      random_(seed, stream_key({"wbc", task.name, std::to_string(index)})),
      stream_(nominal_, task.stream),
      tracker_(nominal_, task.gait),
      layout_(nominal_->dof()),
      actual_(*nominal_),
      wanted_(*nominal_),
      links_(nominal_->roles.bodies) {
  const int n = nominal_->dof();
  scale_ = duet::action_scale(*nominal_);
  for (int side = 0; side < 2; ++side) feet_[side] = tracker_.legs()[side].joints().back() + 1;
  for (const Keypoint& keypoint : nominal_->keypoints) keypoints_.push_back(keypoint.frame);
  hands_ = {nominal_->frames[nominal_->track_frame("lhand")].link,
            nominal_->frames[nominal_->track_frame("rhand")].link};
  push_links_ = {hands_[0], hands_[1], nominal_->frames[nominal_->track_frame("torso")].link};
  action_ = last_action_ = second_last_ = Eigen::VectorXf::Zero(n);
  command_ = late_ = nominal_->default_command(nominal_->neutral);
  reset();
}

void WbcEnvironment::renew_body() {
  Scene scene;
  scene.robot = task_.domain.randomise ? draw_body(*nominal_, task_.domain, random_) : nominal_;
  scene.partner = PartnerMode::kNone;
  scene.dt = task_.dt;
  scene.options = task_.engine;
  if (task_.domain.randomise)
    scene.friction.robot_ground = random_.uniform(task_.domain.friction_low, task_.domain.friction_high);
  backend_ = make_backend("mujoco", scene);
  steps_of_body_ = 0;
}

void WbcEnvironment::draw_gains() {
  const JointCommand nominal = nominal_->default_command(nominal_->neutral);
  command_.kp = nominal.kp;
  command_.kd = nominal.kd;
  latency_ = 0;
  if (!task_.domain.randomise) return;
  const double spread = task_.domain.gain_scale;
  for (int i = 0; i < nominal_->dof(); ++i) {
    command_.kp[i] *= random_.uniform(1.0 - spread, 1.0 + spread);
    command_.kd[i] *= random_.uniform(1.0 - spread, 1.0 + spread);
  }
  latency_ = random_.below(task_.domain.latency + 1);
}

RobotState WbcEnvironment::draw_start() {
  RobotState state = nominal_->standing_state();
  state.X_WB.p.z() = tracker_.root().p.z() + 0.005;
  state.X_WB.R = Eigen::Quaterniond(1.0, random_.uniform(-0.025, 0.025), random_.uniform(-0.025, 0.025),
                                    random_.uniform(-0.05, 0.05))
                     .normalized();
  for (int axis = 0; axis < 3; ++axis) {
    state.v_WB[axis] = random_.uniform(-0.1, 0.1);
    state.w_WB_B[axis] = random_.uniform(-0.1, 0.1);
  }
  for (int i = 0; i < nominal_->dof(); ++i) {
    const RobotJoint& joint = nominal_->joints[i];
    state.q[i] = std::clamp(tracker_.q()[i] + random_.uniform(-0.05, 0.05), joint.lower, joint.upper);
    state.v[i] = random_.uniform(-0.1, 0.1);
  }
  return state;
}

void WbcEnvironment::reset() {
  if (!backend_ || (task_.domain.randomise && steps_of_body_ >= task_.domain.steps_per_body)) renew_body();
  draw_gains();
  stream_.reset(random_);
  tracker_.reset(stream_.reference());
  try {
    backend_->reset(draw_start());
  } catch (const std::invalid_argument&) {  // a drawn pose has a hand in the trunk: begin in the neutral one
    backend_->reset(nominal_->standing_state());
  }
  action_.setZero();
  last_action_.setZero();
  second_last_.setZero();
  command_.q_target = late_.q_target = tracker_.q();
  late_.kp = command_.kp;
  late_.kd = command_.kd;
  tick_ = 0;
  push_ticks_ = 0;
  pushed_ = -1;
  is_pushed_ = task_.domain.push > 0.0 && random_.chance(task_.domain.push_share);
  jumps_ = task_.domain.jump > 0.0 && random_.chance(task_.domain.jump_share);
  X_jump_ = {};
  kick_in_ = random_.uniform(0.5, 4.0);
  top_ = {};
  look();
  look();  // the second time so that feet_before_ is of this episode
}

void WbcEnvironment::disturb() {
  const DomainOptions& domain = task_.domain;
  if (is_pushed_) push();
  if (is_pushed_ || domain.kick <= 0.0) return;
  kick_in_ -= kTick;
  if (kick_in_ > 0.0) return;
  kick_in_ = random_.uniform(domain.kick_from, domain.kick_to);
  const double direction = random_.uniform(-std::numbers::pi, std::numbers::pi),
               speed = random_.uniform(0.0, domain.kick);
  backend_->kick({speed * std::cos(direction), speed * std::sin(direction), 0.0});
}

// Shifts the reference as a policy's plans move when it plans anew: by some centimetres, five times a second.
const Reference& WbcEnvironment::show_reference() {
  if (!jumps_) return stream_.reference();
  const DomainOptions& domain = task_.domain;
  if (tick_ % kTicksPerPlan == 0)
    X_jump_ = {yaw_rotation(random_.uniform(-domain.jump_turn, domain.jump_turn)),
               {random_.uniform(-domain.jump, domain.jump), random_.uniform(-domain.jump, domain.jump), 0.0}};
  shown_ = stream_.reference();
  shown_.X_WB.p += X_jump_.p;
  shown_.X_WB.R = X_jump_.R * shown_.X_WB.R;
  return shown_;
}

// A force on a hand or the torso for a second, from time to time.
void WbcEnvironment::push() {
  if (pushed_ >= 0 && --push_ticks_ <= 0) {
    backend_->push(pushed_, Eigen::Vector3d::Zero(), actual_.p_WL(pushed_));
    pushed_ = -1;
  }
  if (pushed_ >= 0 || !random_.chance(kTick / task_.domain.push_pause)) return;
  pushed_ = push_links_[random_.below(static_cast<int>(push_links_.size()))];
  push_ticks_ = 50;
  const double direction = random_.uniform(-std::numbers::pi, std::numbers::pi);
  const double force = random_.uniform(0.3, 1.0) * task_.domain.push;
  const Eigen::Vector3d f_W(force * std::cos(direction), force * std::sin(direction),
                            random_.uniform(-0.3, 0.3) * force);
  backend_->push(pushed_, f_W, actual_.p_WL(pushed_));
}

void WbcEnvironment::apply(std::span<const float> action) {
  second_last_ = last_action_;
  last_action_ = action_;
  late_.q_target = command_.q_target;
  for (int i = 0; i < nominal_->dof(); ++i) {
    const double a = std::isfinite(action[i]) ? std::clamp<double>(action[i], -kActionBound, kActionBound) : 0.0;
    action_[i] = static_cast<float>(a);
    command_.q_target[i] =
        std::clamp(tracker_.q()[i] + scale_[i] * a, nominal_->joints[i].lower, nominal_->joints[i].upper);
  }
}

Transition WbcEnvironment::step(std::span<const float> action) {
  apply(action);
  disturb();
  const Outcome outcome = step_control_period(
      *backend_, steps_per_tick(task_.dt),
      [this](int i) -> const JointCommand& { return i < latency_ ? late_ : command_; }, [](int) { return true; });
  steps_of_body_ += 1;
  ++tick_;
  stream_.advance(random_);
  tracker_.update(backend_->state(), show_reference());
  look();
  Transition transition{.reward = reward(), .end = EpisodeEnd::kNone};
  if (outcome != Outcome::kOk || fell()) {
    transition = {.reward = transition.reward - task_.reward.fall * kTick, .end = EpisodeEnd::kFell};
  } else if (tick_ >= task_.episode_ticks) {
    transition.end = EpisodeEnd::kTimeUp;
  }
  if (!std::isfinite(transition.reward)) transition.reward = -task_.reward.fall * kTick;
  return transition;
}

bool WbcEnvironment::fell() const {
  const RobotState& state = backend_->state();
  const FallRule fall{nominal_->fall.height + kHigher, nominal_->fall.cos_tilt - kSlacker};
  return has_fallen(state, fall) || (state.X_WB.p - tracker_.root().p).head<2>().norm() > task_.farthest;
}

void WbcEnvironment::look() {
  for (int side = 0; side < 2; ++side) feet_before_.col(side) = actual_.p_WL(feet_[side]);
  actual_.update(backend_->state().X_WB, backend_->state().q);
  wanted_.update(tracker_.root(), tracker_.q());
  read_sensors(backend_->state(), tracker_, sensors_);
  read_contacts();
}

void WbcEnvironment::read_contacts() {
  on_ground_ = {};
  touches_itself_ = false;
  for (const Contact& contact : backend_->contacts()) {
    if (contact.side == ContactSide::kRobot) touches_itself_ = true;
    if (contact.side != ContactSide::kGround) continue;
    for (int side = 0; side < 2; ++side)
      if (contact.link == feet_[side]) on_ground_[side] = true;
  }
  for (int side = 0; side < 2; ++side) lift_[side] = actual_.p_WL(feet_[side]).z() - tracker_.ankle_height();
}

void WbcEnvironment::observe(std::span<float> actor, std::span<float> critic) const {
  write_oracle(sensors_, action_, actor);
  std::copy(actor.begin(), actor.end(), critic.begin());
  write_bodies(actual_, tracker_.root(), links_, critic.subspan(actor.size()));
}

double WbcEnvironment::reward() {
  ++statistics_.ticks;
  double sum = tracking_reward() - effort() - stance_penalty();
  sum += tracker_.gait().stepping() ? stepping_reward() : standing_reward();
  if (touches_itself_) sum -= task_.reward.self_contact;
  return kTick * std::max(sum, -task_.reward.fall);
}

double WbcEnvironment::tracking_reward() {
  const RewardWeights& w = task_.reward;
  const RobotState& state = backend_->state();
  const Pose& root = tracker_.root();
  const double xy = (state.X_WB.p - root.p).head<2>().norm();
  const double attitude = state.X_WB.R.angularDistance(root.R);
  double points = 0.0, turn = 0.0, joints = 0.0, mean = 0.0;
  for (const int frame : keypoints_)
    points += (actual_.frame_position(frame) - wanted_.frame_position(frame)).squaredNorm();
  points = std::sqrt(points / static_cast<double>(keypoints_.size()));
  for (const int link : hands_) turn += 0.5 * std::pow(angle_between(actual_.R_WL(link), wanted_.R_WL(link)), 2);
  turn = std::sqrt(turn);
  for (const int joint : tracker_.upper()) {
    const double error = state.q[joint] - tracker_.q()[joint];
    joints += error * error;
    mean += std::abs(error);
  }
  const auto upper = static_cast<double>(tracker_.upper().size());
  joints = std::sqrt(joints / upper);

  statistics_.root_xy += xy;
  statistics_.heading += attitude;
  statistics_.upper_body += points;
  statistics_.joints += mean / upper;
  return w.root_xy * kernel(xy, w.root_xy_width) + w.root_near * kernel(xy, w.root_near_width) +
         w.upper_body * kernel(points, w.upper_body_width) + w.hands * kernel(turn, w.hands_width) +
         w.joints * kernel(joints, w.joints_width) + w.height * kernel(state.X_WB.p.z() - root.p.z(), w.height_width) +
         w.attitude * kernel(attitude, w.attitude_width);
}

// While the clock runs: feet where it has them, the swinging one lifted and on the way to its place. The root's
// velocity counts as much as the clock is kept, so that leaning over two planted feet does not pay.
double WbcEnvironment::stepping_reward() {
  const RewardWeights& w = task_.reward;
  const Gait& gait = tracker_.gait();
  const int swing = gait.swing_foot();
  const bool high = gait.swing_progress() > 0.15 && gait.swing_progress() < 0.85;  // else both feet may be down
  const double match = (high ? (on_ground_[swing] ? 0.0 : 1.0) : 1.0) + (on_ground_[1 - swing] ? 1.0 : 0.0);
  const double wanted = gait.feet()[swing].lift;
  const double yaw = yaw_of(tracker_.root().R), c = std::cos(yaw), s = std::sin(yaw);
  const Eigen::Vector3d& v = backend_->state().v_WB;
  const Eigen::Vector2d velocity(c * v.x() + s * v.y(), -s * v.x() + c * v.y());
  const double velocity_error = (velocity - gait.velocity().head<2>()).norm();
  const double miss = (actual_.p_WL(feet_[swing]).head<2>() - foothold(swing)).norm();

  ++statistics_.stepping_ticks;
  statistics_.clock += 0.5 * match;
  top_[swing] = std::max(top_[swing], lift_[swing]);
  if (gait.swing_progress() + kTick / gait.half_period() >= 1.0) {
    statistics_.swing_lift += top_[swing];
    ++statistics_.swings;
    top_[swing] = 0.0;
  }
  return w.clock * match + (0.3 + 0.35 * match) * w.velocity * kernel(velocity_error, w.velocity_width) -
         w.lift * lift_cost(lift_[swing] - wanted) +
         w.foothold * gait.swing_progress() * kernel(miss, w.foothold_width);
}

double WbcEnvironment::standing_reward() const {
  double still = 0.0;
  for (int side = 0; side < 2; ++side) still += on_ground_[side] ? 0.5 : 0.0;
  return task_.reward.both_feet * (still == 1.0 ? 1.0 : 0.0);
}

// By how much the robot's capture point is off the reference's (linear inverted pendulum), in W [m]. Feet that are to
// catch a robot go there and a little further.
Eigen::Vector2d WbcEnvironment::carried() const {
  const RobotState& state = backend_->state();
  const Eigen::Vector2d v_ref =
      Eigen::Rotation2Dd(yaw_of(tracker_.root().R)) * Eigen::Vector2d(tracker_.gait().velocity().head<2>());
  Eigen::Vector2d d = (state.X_WB.p - tracker_.root().p).head<2>() + kPendulumTime * (state.v_WB.head<2>() - v_ref);
  d *= kCaptureMargin;
  return d.norm() > kFarthestStep ? Eigen::Vector2d(d * (kFarthestStep / d.norm())) : d;
}

// Where the swinging foot is to come down: half a step ahead of where the root will be then. In W, of the ankle.
Eigen::Vector2d WbcEnvironment::foothold(int side) const {
  const Gait& gait = tracker_.gait();
  const double left = (1.0 - gait.swing_progress()) * gait.half_period(), ahead = left + 0.5 * gait.half_period();
  const double yaw = yaw_of(tracker_.root().R);
  const Eigen::Vector3d& v = gait.velocity();
  const Eigen::Rotation2Dd heading(yaw), then(yaw + v.z() * ahead);
  const double sign = side == 0 ? 1.0 : -1.0;
  return tracker_.root().p.head<2>() + carried() + heading * Eigen::Vector2d(ahead * v.head<2>()) +
         then * Eigen::Vector2d(tracker_.foot_x(), sign * gait.options().half_width);
}

double WbcEnvironment::stance_penalty() const {
  const RewardWeights& w = task_.reward;
  const double yaw = yaw_of(backend_->state().X_WB.R);
  const Eigen::Vector3d d = actual_.p_WL(feet_[0]) - actual_.p_WL(feet_[1]);
  const double width = -std::sin(yaw) * d.x() + std::cos(yaw) * d.y();
  const double widest = w.widest + (tracker_.gait().stepping() ? 0.06 + carried().norm() : 0.0);
  const double outside = std::max(0.0, w.narrowest - width) + std::max(0.0, width - widest);
  return w.stance * std::min(outside, 0.25);
}

double WbcEnvironment::effort() {
  const RewardWeights& w = task_.reward;
  const RobotState& state = backend_->state();
  const double rate = (action_ - last_action_).squaredNorm();
  const double jerk = (action_ - 2.0F * last_action_ + second_last_).squaredNorm();
  double limits = 0.0, slip = 0.0, speed = 0.0;
  for (int i = 0; i < nominal_->dof(); ++i) {
    const RobotJoint& joint = nominal_->joints[i];
    const double middle = 0.5 * (joint.lower + joint.upper), half = 0.475 * (joint.upper - joint.lower);
    limits += std::max(0.0, std::abs(state.q[i] - middle) - half);
  }
  for (int side = 0; side < 2; ++side) {
    for (const int joint : tracker_.legs()[side].joints()) speed += state.v[joint] * state.v[joint];
    if (!on_ground_[side]) continue;
    slip += ((actual_.p_WL(feet_[side]) - feet_before_.col(side)) / kTick).head<2>().squaredNorm();
  }
  statistics_.action_rate += rate;
  return w.action_rate * rate + w.action_jerk * jerk + w.action * action_.squaredNorm() +
         w.torque * backend_->torques().squaredNorm() + w.limits * limits + w.slip * slip + w.joint_speed * speed +
         w.spin * state.w_WB_B.head<2>().squaredNorm();
}

TrackingStatistics WbcEnvironment::take_statistics() {
  const TrackingStatistics taken = statistics_;
  statistics_ = {};
  return taken;
}

}  // namespace duet
