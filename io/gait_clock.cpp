#include "duet/io/gait_clock.h"

#include <cmath>
#include <numbers>

#include "duet/core/clock.h"

namespace duet {
namespace {

constexpr double kTurn = 2.0 * std::numbers::pi;

// Piecewise linear: the first share of a turn takes half of it, the rest the other half.
double warped_angle(double angle, double stance) {
  const double turns = angle / kTurn, place = turns - std::floor(turns);
  return kTurn * (place < stance ? 0.5 * place / stance : 0.5 + 0.5 * (place - stance) / (1.0 - stance));
}

double plain_angle(const GaitClock& clock, std::size_t phase, long tick, const StandGate& gate) {
  const bool gated = !clock.standing.empty();
  if (gated && gate.stands()) return clock.standing[phase];
  const double turns = clock.frequency_hz * kTick * static_cast<double>(gated ? gate.walking_tick() : tick);
  return kTurn * (turns - std::floor(turns)) + clock.phases[phase];
}

}  // namespace

void StandGate::update(double forward, double lateral, double yaw_rate) {
  stands_ = bounds_ && std::hypot(forward, lateral) < bounds_->speed && std::abs(yaw_rate) < bounds_->yaw_rate;
  walking_tick_ = stands_ ? -1 : walking_tick_ + 1;
}

double gait_angle(const GaitClock& clock, std::size_t phase, long tick, const StandGate& gate) {
  const double angle = plain_angle(clock, phase, tick, gate);
  return clock.stance ? warped_angle(angle, *clock.stance) : angle;
}

}  // namespace duet
