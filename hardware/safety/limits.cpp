#include "duet/hardware/safety/limits.h"

#include <algorithm>
#include <cmath>

#include "duet/core/require.h"

namespace duet {
namespace {

using Limits = HardwareLimits;

Field<Limits> row(const char* name, double Limits::*member, double high, const char* unit, const char* meaning) {
  return field<Limits>({.name = name, .meaning = meaning, .unit = unit, .range = {0.0, high, false}}, member);
}

// Numbers that protect by being large: they may only grow.
Field<Limits> at_least_row(const char* name, double Limits::*member, double high, const char* unit,
                           const char* meaning) {
  return field<Limits>({.name = name, .meaning = meaning, .unit = unit, .range = {Limits{}.*member, high, true}},
                       member);
}

}  // namespace

const FieldTable<HardwareLimits>& hardware_limit_fields() {
  static const FieldTable<Limits> table = {
      row("forward", &Limits::forward, 0.25, "m/s", "largest forward speed of the root"),
      row("backward", &Limits::backward, 0.20, "m/s", "largest backward speed of the root"),
      row("lateral", &Limits::lateral, 0.15, "m/s", "largest sideways speed of the root"),
      row("yaw_rate", &Limits::yaw_rate, 0.5, "rad/s", "largest rate of turn"),
      row("height_range", &Limits::height_range, 0.1, "m", "largest distance of the height from its middle"),
      row("height_rate", &Limits::height_rate, 0.1, "m/s", "largest rate of the height"),
      row("acceleration", &Limits::acceleration, 0.5, "m/s^2", "largest acceleration of the root"),
      row("stop_acceleration", &Limits::stop_acceleration, 1.0, "m/s^2", "largest deceleration of the root"),
      row("yaw_acceleration", &Limits::yaw_acceleration, 1.5, "rad/s^2", "largest acceleration of the turn"),
      row("jerk", &Limits::jerk, 5.0, "m/s^3", "largest jerk of the root"),
      at_least_row("joint_margin", &Limits::joint_margin, 0.5, "rad", "by which the joint limits are drawn in"),
      row("arm_speed", &Limits::arm_speed, 1.5, "rad/s", "largest speed of an arm's joint"),
      row("arm_acceleration", &Limits::arm_acceleration, 5.0, "rad/s^2", "largest acceleration of an arm's joint"),
      row("torque_share", &Limits::torque_share, 0.4, "1", "share of a joint's effort that gains may ask for"),
      at_least_row("self_distance", &Limits::self_distance, 0.2, "m", "between the robot's own capsules"),
      row("fence_x", &Limits::fence_x, 5.0, "m", "half the length of the box in which the root stays"),
      row("fence_y", &Limits::fence_y, 5.0, "m", "half the width of that box"),
      at_least_row("human_speed", &Limits::human_speed, 3.0, "m/s", "speed that a person is assumed to have at least"),
      at_least_row("pose_uncertainty", &Limits::pose_uncertainty, 1.0, "m", "by which a person's capsules grow"),
      at_least_row("head_distance", &Limits::head_distance, 1.0, "m", "of every link from head and neck"),
      at_least_row("reaction_time", &Limits::reaction_time, 2.0, "s", "until the robot begins to stop"),
      at_least_row("stopping_time", &Limits::stopping_time, 5.0, "s", "until the robot has stopped"),
      at_least_row("reserve", &Limits::reserve, 1.0, "m", "added to the distance from a person"),
      at_least_row("arm_reach", &Limits::arm_reach, 1.0, "m", "from the shoulder to the fingertips"),
      at_least_row("arm_mass", &Limits::arm_mass, 35.0, "kg", "that moves with a hand that touches somebody"),
      row("shoulder_torque", &Limits::shoulder_torque, 5.0, "N m", "beyond the model's, which is touch"),
      row("wrist_torque", &Limits::wrist_torque, 2.0, "N m", "the same of a wrist"),
      row("contact_time", &Limits::contact_time, 0.04, "s", "for which a touch lasts until it counts"),
      row("release_effort", &Limits::release_effort, 0.6, "1", "share of a joint's effort that opens the arms"),
      row("release_force", &Limits::release_force, 0.5, "1", "share of the contact limit that opens the arms"),
      row("contact_lever", &Limits::contact_lever, 0.3, "m", "of a touch from the shoulder"),
      row("step_back", &Limits::step_back, 0.1, "m/s", "speed after the arms have opened")};
  return table;
}

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

double touch_speed(const RegionLimits& region, double robot_mass) {
  require(region.quasi_static_n && region.stiffness_n_mm && region.mass_kg,
          "contact limits of region '{}': expected quasi_static_n, stiffness_n_mm and mass_kg, found less",
          region.region);
  require(robot_mass > 0.0, "touch speed: expected a mass above 0 kg, found {}", robot_mass);
  const double reduced_mass = 1.0 / (1.0 / *region.mass_kg + 1.0 / robot_mass);
  return *region.quasi_static_n / std::sqrt(reduced_mass * *region.stiffness_n_mm * 1000.0);
}

}  // namespace duet
