#include "duet/controllers/wbc_sim/gait.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "duet/core/clock.h"
#include "duet/core/smooth_step.h"

namespace duet {
namespace {

constexpr double kFilter = kTick / 0.15;  // of the reference's velocity
constexpr int kHalfCyclesAtRest = 2;      // in which the feet come together before they stand

}  // namespace

void Gait::reset() { *this = Gait(options_); }

void Gait::update(const Eigen::Vector3d& velocity, const Eigen::Vector3d& deviation) {
  velocity_ += kFilter * (velocity - velocity_);
  const double speed = velocity_.head<2>().norm();
  if (speed > options_.max_speed) velocity_.head<2>() *= options_.max_speed / speed;
  velocity_.z() = std::clamp(velocity_.z(), -options_.max_turn, options_.max_turn);

  const bool wanted =
      velocity_.head<2>().norm() > options_.still_speed || std::abs(velocity_.z()) > options_.still_turn ||
      deviation.head<2>().norm() > options_.start_distance || std::abs(deviation.z()) > options_.start_angle;
  if (!stepping_) {
    if (wanted) start(deviation);
    return;
  }
  const double before = phase_;
  phase_ += kTick * options_.frequency;
  share_ = std::min(1.0, share_ + kTick / half_period());
  const bool switched = (before < 0.5) != (phase_ < 0.5) || phase_ >= 1.0;
  if (phase_ >= 1.0) phase_ -= 1.0;
  if (!switched) return;
  resting_ = wanted ? 0 : resting_ + 1;
  if (resting_ > kHalfCyclesAtRest) stepping_ = false;
}

// The first foot to leave the ground is the one on the side that the robot goes to.
void Gait::start(const Eigen::Vector3d& deviation) {
  const double side = velocity_.y() + 0.3 * velocity_.z() + 2.0 * deviation.y();
  phase_ = side >= 0.0 ? 0.0 : 0.5;
  share_ = 0.0;
  resting_ = 0;
  stepping_ = true;
}

std::array<FootPlace, 2> Gait::feet() const { return {foot(0), foot(1)}; }

// In stance a foot stays where it is while the root passes over it; in swing it goes from half a step behind to half a
// step ahead. Turns rotate the place about the root.
FootPlace Gait::foot(int side) const {
  const double sign = side == 0 ? 1.0 : -1.0;
  if (!stepping_) return {.x = 0.0, .y = sign * options_.half_width};
  const double progress = swing_progress();
  const bool swings = side == swing_foot();
  const double ahead = (swings ? smooth_step(progress) - 0.5 : 0.5 - progress) * half_period();  // [s]
  const double yaw = velocity_.z() * ahead;
  FootPlace place;
  place.x = velocity_.x() * ahead - std::sin(yaw) * sign * options_.half_width;
  place.y = velocity_.y() * ahead + std::cos(yaw) * sign * options_.half_width;
  place.yaw = yaw;
  if (swings) place.lift = share_ * options_.swing_height * 0.5 * (1.0 - std::cos(2.0 * std::numbers::pi * progress));
  return place;
}

}  // namespace duet
