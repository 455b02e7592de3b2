// The numbers of the safety envelope: what a command to the robot may at most be. Defaults are for a robot beside a
// person; a configuration may lower most of them and raise none above its ceiling (docs/hardware.md). Not safety-rated.
#pragma once

#include "duet/core/field.h"
#include "duet/metrics/contact_limits.h"

namespace duet {

struct HardwareLimits {
  // Limits of the root, in its heading frame.
  double forward = 0.25, backward = 0.20, lateral = 0.15;  // [m/s]
  double yaw_rate = 0.5;                                   // [rad/s]
  double height = 0.74, height_range = 0.1;                // of the pelvis: middle, largest distance from it [m]
  double height_rate = 0.1;                                // [m/s]
  double acceleration = 0.5, stop_acceleration = 1.0;      // [m/s^2]
  double yaw_acceleration = 1.5;                           // [rad/s^2]
  double jerk = 5.0;                                       // [m/s^3], [rad/s^3]
  // Limits of the arms.
  double joint_margin = 0.05;           // that the robot's joint limits are drawn in [rad]
  double arm_speed = 0.5;               // [rad/s]
  double arm_acceleration = 5.0;        // [rad/s^2]
  double torque_share = 0.4;            // of a joint's effort, that position and damping gains may ask for
  double self_distance = 0.03;          // between the robot's own capsules [m]
  double fence_x = 2.0, fence_y = 2.0;  // half the box around the start in which the root stays [m]
  // Limits near a person; a robot at speed v keeps S = human_speed (reaction + stopping) + v (reaction + stopping / 2)
  // + reserve. Source: ISO/TS 15066, 5.5.4 (speed and separation monitoring), from secondary sources.
  double human_speed = 1.6;                          // assumed at least [m/s]
  double pose_uncertainty = 0.10;                    // by which a person's capsules grow [m]
  double head_distance = 0.25;                       // of every link from head and neck, always [m]
  double reaction_time = 0.13, stopping_time = 0.6;  // [s]
  double reserve = 0.1;                              // [m]
  double arm_reach = 0.6;  // from the shoulder to the fingertips: what turns arm_speed into m/s [m]
  double arm_mass = 3.0;   // that moves with a hand that touches somebody [kg]
  // Limits of contact.
  double shoulder_torque = 5.0, wrist_torque = 2.0;  // beyond the model's, which count as touch [N m]
  double contact_time = 0.04;                        // for which it lasts [s]
  double release_effort = 0.6;                       // share of a joint's effort at which the arms open
  double release_force = 0.5;                        // share of the contact limit at which the arms open
  double contact_lever = 0.3;                        // of a touch from the shoulder [m]
  double step_back = 0.1;                            // speed after the arms have opened [m/s]
};

// Fields in the order of the struct, without the middle of the height; each range ends at the ceiling.
const FieldTable<HardwareLimits>& hardware_limit_fields();

// One number that follows a target within bounds on itself, on its rate and on the change of its rate: an arm's joint
// (angle, speed, acceleration) or a direction of the root (speed, acceleration, jerk). Pure functions; thread-safe.

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

// How fast a part of the robot may be when it touches a person. Pure; thread-safe.

// The largest relative speed of a quasi-static contact, F = v sqrt(mu k) with 1/mu = 1/m_person + 1/m_robot [m/s]; the
// transient limit is twice the force and is not made use of. `robot_mass`: that moves with the part [kg]. Throws
// std::invalid_argument for a region without force, stiffness or mass. Source: ISO/TS 15066, A.3.6, from secondary
// sources.
double touch_speed(const RegionLimits& region, double robot_mass);

}  // namespace duet
