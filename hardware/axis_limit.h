// One number that follows a target within bounds on itself, on its rate and on the change of its rate: an arm's joint
// (angle, speed, acceleration) or a direction of the root (speed, acceleration, jerk). Pure functions; thread-safe.
#pragma once

namespace duet {

struct AxisBounds {
  double lower = 0.0, upper = 0.0;  // of the value
  double rate = 0.0;                // largest size of its rate [1/s]
  double stop_rate = 0.0;           // the same while the value goes towards 0; at least `rate` [1/s]
  double rate_change = 0.0;         // largest change of the rate in a second [1/s^2]
};

// From rest within the bounds, follow() and brake() keep these: the value can always be brought to rest inside.
struct AxisState {
  double value = 0.0;
  double rate = 0.0;  // of the last tick [1/s]
};

// Limits that kept the value from its target.
struct AxisClamps {
  bool value = false;        // the target lay outside
  bool rate = false;         // it would have needed a larger rate
  bool rate_change = false;  // it would have needed a larger change of the rate
};

// The largest rate of this tick from which a rate that falls by `step` each tick is at most `floor` before `distance`
// is used up. `distance`, `floor` >= 0, `step` and `dt` > 0.
double largest_rate(double distance, double step, double dt, double floor = 0.0);

// The state after one tick of `dt` seconds towards `target` (finite), ahead of which it slows down. A value outside the
// bounds may only go inwards.
AxisState follow(double target, const AxisState& before, const AxisBounds& bounds, double dt, AxisClamps& clamps);
// The state after one tick in which the rate goes to 0 as fast as it may.
AxisState brake(const AxisState& before, const AxisBounds& bounds, double dt);
// The value at which brake() comes to rest.
double rest_value(const AxisState& state, const AxisBounds& bounds, double dt);

}  // namespace duet
