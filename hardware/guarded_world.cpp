#include "duet/hardware/guarded_world.h"

#include <fmt/format.h>

#include <cmath>
#include <utility>

#include "duet/core/clock.h"
#include "duet/hardware/guard_loop.h"

namespace duet {
namespace {

constexpr int kPersonRate = 30;  // [Hz]

// Whether a picture of 30 in a second falls into this tick.
bool sees_at(int tick) { return tick == 0 || tick * kPersonRate / 50 != (tick - 1) * kPersonRate / 50; }

std::string place_of(const GuardReport& report) {
  return fmt::format("{} ({})", safety_state_name(report.state), stop_cause_name(report.cause));
}

}  // namespace

PartnerSource partner_of_clip(const PointTracks& partner) {
  return [&partner](int tick, HumanJoints& joints) {
    if (partner.empty() || !sees_at(tick)) return false;
    joints = partner_joints(partner, tick);
    return true;
  };
}

GuardedWorld::GuardedWorld(GuardedEpisode episode, std::shared_ptr<const RobotModel> robot, GuardLink& link)
    : episode_(std::move(episode)),
      robot_(std::move(robot)),
      link_(link),
      velocity_(episode_.odometry, episode_.limits, episode_.steps_from),
      fall_(robot_->fall) {
  message_to_guard_.command.q = robot_->neutral;
  target_ = robot_->neutral;
  state_ = robot_->standing_state();
  // Above whatever a planner before this one has sent.
  person_.sequence = message_to_guard_.sequence = static_cast<std::uint64_t>(monotonic_seconds() * 1e6);
}

bool GuardedWorld::next() {
  const std::uint64_t before = report_.tick;
  if (!link_.next(report_)) {
    message_ = fmt::format("{} has gone: no report in {} s", link_.name(), link_.patience());
    return false;
  }
  if (report_.state != last_state_ && episode_.watch) episode_.watch(report_);
  last_state_ = report_.state;
  if (before > 0 && report_.tick > before) missed_ += static_cast<int>((report_.tick - before) / kReportEvery) - 1;
  return true;
}

void GuardedWorld::plan(const VelocityCommand& root, const Eigen::VectorXd& q, bool acting) {
  ++message_to_guard_.sequence;
  message_to_guard_.command.stamp = report_.now;
  message_to_guard_.command.root = root;
  message_to_guard_.command.q = q;
  message_to_guard_.acting = acting;
  (void)link_.send(message_to_guard_);
}

void GuardedWorld::begin(const RobotState& start) {
  if (!next()) throw std::runtime_error(message_);
  const double asked_at = report_.now;
  message_to_guard_.goal.reset();
  while (report_.state != SafetyState::kRun) {
    if (report_.state >= SafetyState::kHold || report_.now - asked_at > episode_.most_wait)
      throw std::runtime_error(fmt::format("{} does not run: it is at {} after {:.1f} s", link_.name(),
                                           place_of(report_), report_.now - asked_at));
    lay_world(start.X_WB);
    show_person(0);
    plan({0.0, 0.0, 0.0, episode_.limits.height}, robot_->neutral, false);
    if (!next()) throw std::runtime_error(message_);
  }
  lay_world(start.X_WB);
  velocity_.reset();
  missed_ = 0;
  began_at_ = report_.now;
  clamps_before_ = report_.clamps;
  take_state();
}

void GuardedWorld::lay_world(const Pose& start) {
  const Pose& X_OB = report_.robot.X_WB;
  yaw_OE_ = yaw_of(X_OB.R) - yaw_of(start.R);
  p_OE_ = X_OB.p - yaw_rotation(yaw_OE_) * start.p;
  p_OE_.z() = 0.0;
}

Pose GuardedWorld::to_odometry(const Pose& X_EB) const {
  const Eigen::Quaterniond R_OE = yaw_rotation(yaw_OE_);
  return {R_OE * X_EB.R, p_OE_ + R_OE * X_EB.p};
}

void GuardedWorld::take_state() {
  const Eigen::Quaterniond R_EO = yaw_rotation(-yaw_OE_);
  state_ = report_.robot;
  state_.X_WB = {R_EO * report_.robot.X_WB.R, R_EO * (report_.robot.X_WB.p - p_OE_)};
  state_.v_WB = R_EO * report_.robot.v_WB;
  for (std::size_t k = 0; k < kClampReasons; ++k) clamps_[k] = report_.clamps[k] - clamps_before_[k];
}

void GuardedWorld::show_person(int tick) {
  HumanJoints joints;
  if (!episode_.person || !episode_.person(tick, joints)) return;
  const Eigen::Quaterniond R_OE = yaw_rotation(yaw_OE_);
  for (int j = 0; j < joints.cols(); ++j) person_.joints.col(j) = p_OE_ + R_OE * joints.col(j);
  ++person_.sequence;
  (void)link_.send(person_);
}

// The guard gets what the reference asks for; what it makes of it is in its next report.
const Eigen::VectorXd& GuardedWorld::target(const Reference& reference) {
  const Reference goal{to_odometry(reference.X_WB), reference.q};
  const OdometrySample odometry{report_.robot.X_WB, report_.robot.v_WB, report_.odometry_at, report_.odometry};
  const VelocityCommand root = velocity_.update(odometry, goal, report_.now);
  show_person(tick_);
  message_to_guard_.goal = goal.X_WB;
  plan(root, reference.q, tick_ >= episode_.act_begin && tick_ < episode_.act_end);
  target_ = report_.q_target;
  for (const int joint : episode_.joints) target_[joint] = reference.q[joint];
  return target_;
}

Outcome GuardedWorld::advance(int tick, const PointTracks&, Deadline&) {
  tick_ = tick + 1;
  if (!next()) return Outcome::kError;
  take_state();
  if (report_.state == SafetyState::kHold) ++held_ticks_;
  if (has_fallen(state_, fall_)) return Outcome::kFell;
  if (report_.state == SafetyState::kRun || report_.state == SafetyState::kHold) return Outcome::kOk;
  message_ = fmt::format("{} ended the run at {:.2f} s: {}", link_.name(), (tick + 1) * kTick, place_of(report_));
  return Outcome::kError;
}

void GuardedWorld::rest(double seconds) {
  const double end = report_.now + seconds;
  message_to_guard_.goal.reset();
  while (report_.now < end) {
    show_person(tick_);
    plan({0.0, 0.0, 0.0, episode_.limits.height}, robot_->neutral, false);
    if (!next()) return;
  }
}

}  // namespace duet
