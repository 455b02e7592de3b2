// How far leg odometry goes wrong: a robot walks in a physics engine under a controller, and its legs say where it is.
// Effects that the engine does not have - a foot that sinks in, an encoder that is bent - are not in the figure.
#pragma once

#include <memory>
#include <string>

#include "duet/robots/robot_model.h"

namespace duet {

struct OdometryTrial {
  std::string engine = "mujoco", controller = "wbc_sim";
  Eigen::Vector3d velocity = {0.3, 0.0, 0.0};  // asked for from the first second on [m/s, m/s, rad/s]
  double seconds = 12.0;
  // Standard deviations of what is measured, drawn 500 times a second.
  double joint_noise = 0.0, joint_speed_noise = 0.0;  // [rad], [rad/s]
  double gyro_noise = 0.0, tilt_noise = 0.0;          // [rad/s], [rad]
  double force_noise = 0.0, force_bias = 0.0;         // of the accelerometer; the bias is the same on all axes [m/s^2]
  double lost = 0.0;                                  // share of states that are not read
  std::uint64_t seed = 1;
};

struct OdometryError {
  double walked = 0.0;     // length of the base's way in the plane, at 5 Hz: without its sway [m]
  double end = 0.0;        // of the place at the end, in the plane [m]
  double largest = 0.0;    // at any time [m]
  double height = 0.0;     // largest of the height [m]
  double speed_rms = 0.0;  // of the velocity in the plane [m/s]
  bool fell = false;
};

// Throws as make_backend and make_controller.
OdometryError measure_leg_odometry(const std::shared_ptr<const RobotModel>& robot, const OdometryTrial& trial);

}  // namespace duet
