#include "duet/hardware/axis_limit.h"

#include <algorithm>
#include <cmath>

namespace duet {
namespace {

double clamped(double value, double lower, double upper, bool& was_clamped) {
  const double inside = std::clamp(value, lower, upper);
  was_clamped = inside != value;
  return inside;
}

// Towards 0 the larger rate is allowed as far as `rate` can be reached again before 0 is crossed.
double rate_bound(double distance_to_zero, const AxisBounds& bounds, double dt) {
  if (distance_to_zero <= 0.0) return bounds.rate;
  return std::min(bounds.stop_rate, largest_rate(distance_to_zero, bounds.rate_change * dt, dt, bounds.rate));
}

}  // namespace

double largest_rate(double distance, double step, double dt, double floor) {
  const double ticks_of_distance = distance / dt;
  const double half = floor + 0.5 * step;
  const double n = std::ceil((std::sqrt(half * half + 2.0 * step * ticks_of_distance) - half) / step);
  if (n <= 0.0) return floor;
  const double above = (ticks_of_distance - n * floor) / n + 0.5 * step * (n - 1.0);
  return floor + std::max(above, 0.0);
}

AxisState follow(double target, const AxisState& before, const AxisBounds& bounds, double dt, AxisClamps& clamps) {
  const double step = bounds.rate_change * dt;
  const double distance = clamped(target, bounds.lower, bounds.upper, clamps.value) - before.value;
  double rate = std::copysign(largest_rate(std::abs(distance), step, dt), distance);
  rate = clamped(rate, -rate_bound(before.value, bounds, dt), rate_bound(-before.value, bounds, dt), clamps.rate);
  rate = clamped(rate, before.rate - step, before.rate + step, clamps.rate_change);
  rate = std::min(rate, largest_rate(std::max(bounds.upper - before.value, 0.0), step, dt));
  rate = std::max(rate, -largest_rate(std::max(before.value - bounds.lower, 0.0), step, dt));
  return {before.value + rate * dt, rate};
}

AxisState brake(const AxisState& before, const AxisBounds& bounds, double dt) {
  const double size = std::max(std::abs(before.rate) - bounds.rate_change * dt, 0.0);
  const double rate = std::copysign(size, before.rate);
  return {before.value + rate * dt, rate};
}

double rest_value(const AxisState& state, const AxisBounds& bounds, double dt) {
  const double step = bounds.rate_change * dt;
  const double size = std::abs(state.rate);
  const double n = std::floor(size / step);  // ticks until it rests
  return state.value + std::copysign(dt * (n * size - 0.5 * step * n * (n + 1.0)), state.rate);
}

}  // namespace duet
