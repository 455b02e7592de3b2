#include "duet/hardware/limits.h"

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

}  // namespace duet
