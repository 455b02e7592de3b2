// The robot as a Simbody multibody tree: poses, mass matrix and bias forces of a state, in the generalised velocity of
// robots/kinematics.h. Nothing but the last state is kept. One per backend; not shared between threads. Simbody's
// headers are C++17, so this one is too.
#pragma once

#include <Eigen/Core>
#include <memory>
#include <string>
#include <vector>

#include "duet/core/robot_state.h"
#include "duet/robots/robot_model.h"

namespace duet {

std::string simbody_version();

class SimbodyModel {
 public:
  // Keeps the robot model alive. Throws what Simbody does.
  SimbodyModel(std::shared_ptr<const RobotModel> robot, const Eigen::Vector3d& gravity_W);
  ~SimbodyModel();
  SimbodyModel(const SimbodyModel&) = delete;
  SimbodyModel& operator=(const SimbodyModel&) = delete;

  // Poses and mass matrix of `state`; no forces are applied.
  void update(const RobotState& state);
  // Applies a force at a point of a link, until the next update. [N], frame W; [m], frame L.
  void apply(int link, const Eigen::Vector3d& f_W, const Eigen::Vector3d& p_L);
  // The bias of velocities, gravity and applied forces: the forces that give zero acceleration, as Dynamics::bias().
  const Eigen::VectorXd& update_bias();

  [[nodiscard]] const std::vector<Eigen::Matrix3d>& rotations() const { return R_WL_; }  // of links
  [[nodiscard]] const std::vector<Eigen::Vector3d>& positions() const { return p_WL_; }
  [[nodiscard]] const Eigen::MatrixXd& mass() const { return mass_; }  // without armature

 private:
  struct Tree;  // Simbody's
  void write(const RobotState& state);
  void read_poses();
  void read_mass();

  std::shared_ptr<const RobotModel> robot_;
  std::unique_ptr<Tree> tree_;
  std::vector<Eigen::Matrix3d> R_WL_;
  std::vector<Eigen::Vector3d> p_WL_, axes_W_;
  Eigen::MatrixXd mass_;
  Eigen::VectorXd bias_;
};

}  // namespace duet
