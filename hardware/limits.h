// The numbers of the safety envelope: what a command to the robot may at most be. Defaults are for a robot beside a
// person; a configuration may lower most of them and raise none above its ceiling (docs/hardware.md). Not safety-rated.
#pragma once

#include "duet/core/field.h"

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

}  // namespace duet
