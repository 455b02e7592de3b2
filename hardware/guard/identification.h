// A standing robot measured beside its card: mass and centre of mass by the torques of its legs, the lean
// of its IMU by its soles, zeros of its legs by the two soles. `duet hw check --identify`; docs/hardware.md,
// "Identification". Nothing is commanded. One owner, one thread.
#pragma once

#include <memory>
#include <nlohmann/json.hpp>
#include <string>

#include "duet/hardware/wire/low_level_frame.h"
#include "duet/robots/robot_model.h"

namespace duet {

// Frames: of heading, x ahead and y left, z up by the IMU.
struct StandingFindings {
  long states = 0;
  double mass = 0.0, card_mass = 0.0;              // [kg]
  Eigen::Vector2d com = Eigen::Vector2d::Zero();   // of the centre of mass, less the card's [m]
  Eigen::Vector2d lean = Eigen::Vector2d::Zero();  // of the IMU over the floor under the soles: roll, pitch [rad]
  Eigen::Vector2d lean_by_force = Eigen::Vector2d::Zero();  // the same over the direction of what the legs carry [rad]
  double soles_apart = 0.0;                                 // angle between the two soles [rad]
  double soles_height = 0.0;                                // of the left one over the right one [m]
  double arm_torque = 0.0;                                  // largest beyond the model's [N m]
  int arm_joint = -1;                                       // which has it
};

class StandingIdentification {
 public:
  // Throws as FootLoad does.
  explicit StandingIdentification(std::shared_ptr<const RobotModel> robot);

  void see(const RobotReading& reading);
  // Throws std::runtime_error where the states are not of a robot that stood: fewer than a second of them, a joint that
  // moved, straight knees, legs that carry less than half of its mass.
  [[nodiscard]] StandingFindings findings() const;

 private:
  std::shared_ptr<const RobotModel> robot_;
  long states_ = 0;
  Eigen::VectorXd q_, tau_, least_q_, most_q_;      // sums, and the range
  Eigen::Vector3d up_B_ = Eigen::Vector3d::Zero();  // sum
};

std::string findings_text(const StandingFindings& findings, const RobotModel& robot);
nlohmann::json findings_json(const StandingFindings& findings, const RobotModel& robot);

}  // namespace duet
