#include "duet/hardware/guard/goal_walk.h"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace duet {
namespace {

// Found over a twin under HOMIE, with other goals and noise than those of the figures in docs/hardware.md.
constexpr double kTurnGain = 1.5;        // of a walker that answers every command [1/s]
constexpr double kFaced = 0.3;           // from here on it turns while it walks [rad]
constexpr double kSteerGain = 1.0;       // [1/s]
constexpr double kMostSteering = 0.3;    // [rad/s]
constexpr double kSteersFrom = 0.3;      // nearer than this the bearing says little [m]
constexpr double kTurnFrom = 0.10;       // a smaller error of the heading is left alone [rad]
constexpr double kStepTurnFrom = 0.14;   // the same of one that steps: half of its least turn [rad]
constexpr double kStepCoast = 0.14;      // by which one that steps turns on once it is told to stand [rad]
constexpr double kSmoothCoast = 0.03;    // the same of one that answers every command [rad]
constexpr double kShort = 0.07;          // of the goal: the place that it keeps while it turns [m]
constexpr double kPlaceGain = 1.0;       // [1/s]
constexpr double kMostKeeping = 0.10;    // [m/s]
constexpr double kLeastDistance = 0.02;  // below which a direction from the goal says little [m]
constexpr double kArrived = 0.14;        // [m]
constexpr double kStopsAgain = 0.12;     // instead of kBrakeDistance where it has stopped too short [m]
constexpr double kStepsOn = 0.04;        // by which one that steps drifts on after it has braked [m]
constexpr int kMostTries = 3;            // walks to one goal
constexpr int kLeastTurn = 15;           // ticks; in fewer HOMIE does not begin a step
constexpr int kSettle = 40;              // ticks until it stands after a burst

double wrapped(double angle) { return std::remainder(angle, 2.0 * std::numbers::pi); }

}  // namespace

GoalWalk::GoalWalk(const HardwareLimits& limits, const LeastSteps& least) : limits_(limits), least_(least) {}

void GoalWalk::reset() {
  enter(Phase::kStanding);
  tries_ = 0;
}

void GoalWalk::enter(Phase phase) {
  phase_ = phase;
  ticks_ = 0;
}

GoalWalk::Sight GoalWalk::sight_of(const RobotState& measured, const Pose& goal) {
  const double yaw = yaw_of(measured.X_WB.R);
  const Eigen::Rotation2Dd R_HW(-yaw);
  Sight sight;
  sight.residual = R_HW * (goal.p - measured.X_WB.p).head<2>();
  sight.bearing = std::atan2(sight.residual.y(), sight.residual.x());
  sight.turn = wrapped(yaw_of(goal.R) - yaw);
  sight.speed = (R_HW * measured.v_WB.head<2>()).x();
  return sight;
}

VelocityCommand GoalWalk::update(const RobotState& measured, const Pose& goal) {
  VelocityCommand command;
  command.height = std::clamp(goal.p.z(), limits_.height - limits_.height_range, limits_.height + limits_.height_range);
  const Sight sight = sight_of(measured, goal);
  if (phase_ == Phase::kStanding) decide(sight, measured, goal);
  ++ticks_;
  switch (phase_) {
    case Phase::kStanding:
      break;
    case Phase::kFacing:
      face(sight, measured, command);
      break;
    case Phase::kWalking:
      walk(sight, command);
      break;
    case Phase::kBraking:
      brake(sight, command);
      break;
    case Phase::kAligning:
      align(sight, measured, command);
      break;
    case Phase::kSettling:
      if (ticks_ >= kSettle) enter(Phase::kStanding);
      break;
  }
  return command;
}

// One that walked and stopped too far away, or drifted while it turned, tries again.
void GoalWalk::decide(const Sight& sight, const RobotState& measured, const Pose& goal) {
  const double distance = sight.residual.norm();
  const bool tries_again = tries_ > 0 && tries_ < kMostTries && distance > kArrived;
  if (distance > kResumeDistance || tries_again) {
    if (!tries_again) tries_ = 0;
    side_ = std::copysign(1.0, sight.bearing);
    place_ = measured.X_WB.p.head<2>();
    return enter(Phase::kFacing);
  }
  if (std::abs(sight.turn) <= (least_.yaw > 0.0 ? kStepTurnFrom : kTurnFrom)) return;
  side_ = std::copysign(1.0, sight.turn);
  // As near as it should be, on the side of the goal on which its walk began: where it stopped may be at the goal.
  const Eigen::Vector2d to = goal.p.head<2>();
  const bool has_walked = tries_ > 0 && (place_ - to).norm() > kLeastDistance;
  const Eigen::Vector2d from_goal = (has_walked ? place_ : measured.X_WB.p.head<2>()) - to;
  place_ = to + kShort / std::max(from_goal.norm(), kLeastDistance) * from_goal;
  enter(Phase::kAligning);
}

// Turns at least as fast as it steps from, slower near the end where it may; a step drifts, and is led back.
void GoalWalk::turn_in_place(double error, const RobotState& measured, VelocityCommand& command) {
  if (std::abs(error) < 0.5 * std::numbers::pi) side_ = std::copysign(1.0, error);  // behind it both sides are as near
  const double least = std::min(least_.yaw, limits_.yaw_rate);
  command.yaw_rate = side_ * std::clamp(kTurnGain * std::abs(error), least, limits_.yaw_rate);
  const Eigen::Rotation2Dd R_HW(-yaw_of(measured.X_WB.R));
  const Eigen::Vector2d back = kPlaceGain * (R_HW * (place_ - measured.X_WB.p.head<2>()));
  command.forward = std::clamp(back.x(), -kMostKeeping, kMostKeeping);
  command.lateral = std::clamp(back.y(), -kMostKeeping, kMostKeeping);
}

void GoalWalk::face(const Sight& sight, const RobotState& measured, VelocityCommand& command) {
  if (std::abs(sight.bearing) > kFaced) return turn_in_place(sight.bearing, measured, command);
  enter(Phase::kWalking);
  walk(sight, command);
}

void GoalWalk::walk(const Sight& sight, VelocityCommand& command) {
  const double first = kBrakeDistance + (least_.forward > 0.0 ? kStepsOn : 0.0);
  if (sight.residual.x() <= (tries_ > 0 ? kStopsAgain : first)) {
    enter(Phase::kBraking);
    ++tries_;
    return brake(sight, command);
  }
  command.forward = std::min(std::max(kReferenceSpeed, least_.forward), limits_.forward);
  if (sight.residual.norm() > kSteersFrom)
    command.yaw_rate = std::clamp(kSteerGain * sight.bearing, -kMostSteering, kMostSteering);
}

// At most as long as A.4.3 brakes.
void GoalWalk::brake(const Sight& sight, VelocityCommand& command) {
  if (sight.speed < kBrakeSpeed || ticks_ > kMostBrakeTicks) return enter(Phase::kSettling);
  command.forward = -std::min(kReferenceSpeed, limits_.backward);
}

void GoalWalk::align(const Sight& sight, const RobotState& measured, VelocityCommand& command) {
  const bool left_alone = sight.residual.norm() > kResumeDistance + kBrakeDistance;  // by a goal that goes on
  const double coast = least_.yaw > 0.0 ? kStepCoast : kSmoothCoast;
  const bool turned = std::abs(sight.turn) <= coast && ticks_ > (least_.yaw > 0.0 ? kLeastTurn : 0);
  if (left_alone || turned) return enter(Phase::kSettling);
  turn_in_place(sight.turn, measured, command);
}

}  // namespace duet
