// A robot on flat ground in a world of Simbody's. Simbody's headers are not C++20: simbody_world.cpp alone includes
// them and is compiled as C++17, so this header and those of duet that it includes are read as both.
#pragma once

#include <Eigen/Core>
#include <functional>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "duet/core/robot_state.h"
#include "duet/robots/robot_model.h"

namespace own {

struct SimbodySettings {
  Eigen::Vector3d gravity = Eigen::Vector3d::Zero();                     // [m/s^2], W
  double friction_ground = 0.0, friction_robot = 0.0;                    // of the pairs
  double stiffness = 0.0, dissipation = 0.0, transition_velocity = 0.0;  // of a surface [Pa], [s/m], [m/s]
  double stop_stiffness = 0.0, stop_dissipation = 0.0;                   // of a joint's stop [N m/rad], [s/rad]
  double inner_step = 0.0;                                               // of the integrator [s]
  bool self_collision = true;
};

struct SurfaceContact {
  int first_surface = 0, second_surface = 0;      // of Simbody's
  int link = -1, other = -1;                      // links of the robot; other: -1 for the ground
  Eigen::Vector3d p_W = Eigen::Vector3d::Zero();  // at the start of the last inner step that had it [m]
  Eigen::Vector3d f_W = Eigen::Vector3d::Zero();  // on `link`, mean over the step [N]
  double depth = 0.0;                             // with p_W [m]
};

// A force in W [N] at a point of a link [m], for each link.
using LinkForces = std::vector<std::pair<Eigen::Vector3d, Eigen::Vector3d>>;

class SimbodyWorld {
 public:
  // Torques of the joints [N m] at a state with these contacts; asked at each inner step.
  using Drive = std::function<const Eigen::VectorXd&(const duet::RobotState&, const std::vector<SurfaceContact>&)>;

  SimbodyWorld(const duet::RobotModel& robot, const SimbodySettings& settings, Drive drive);
  ~SimbodyWorld();

  // From `state` over `inner_steps` of the integrator, a function of state and forces. False where the integrator gives
  // up.
  bool advance(duet::RobotState& state, int inner_steps, const LinkForces& forces);
  [[nodiscard]] const std::vector<SurfaceContact>& contacts() const;  // of the last call

 private:
  struct Parts;
  class Loads;
  std::unique_ptr<Parts> parts_;
};

std::string simbody_version();

}  // namespace own
