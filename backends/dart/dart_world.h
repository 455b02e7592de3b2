// A scene as DART sees it: one skeleton without shapes, its contact rows and joint stops, and the step of
// simulation::World taken apart so that the torque law can look at what the contacts did.
#pragma once

#include <Eigen/Core>
#include <memory>
#include <span>
#include <vector>

#include "duet/backends/backend.h"
#include "duet/backends/dart/alignment.h"
#include "duet/backends/engine_module.h"
#include "duet/backends/narrow_phase.h"
#include "duet/backends/physics_backend.h"
#include "duet/core/robot_state.h"

namespace dart::dynamics {
class BodyNode;
class FreeJoint;
class Skeleton;
}  // namespace dart::dynamics

namespace duet {

class ContactRows;
class GroupSolver;
class ImplicitHinge;

std::span<const EngineOption> dart_options();

class DartWorld {
 public:
  DartWorld(const Scene& scene, std::size_t contact_capacity);  // keeps the robot model alive
  ~DartWorld();

  void write_state(const RobotState& state);
  void kick(const Eigen::Vector3d& dv_W);  // adds to the base's velocity
  void read_state(RobotState& state) const;
  // DART's own coordinates, from which a run continues bitwise: 2 (6 + dof) numbers.
  void append_to(std::vector<double>& values) const;
  void read_from(std::span<const double> values);

  // Poses of the links at the current state.
  void read_poses(std::vector<Eigen::Matrix3d>& R_WL, std::vector<Eigen::Vector3d>& p_WL) const;
  // Forces of the coming step beside the law and the contacts.
  void apply(const ExternalForces& pushes);
  // `state`: as read_state() gives it. False where the velocities left any sensible range: then the state is useless.
  [[nodiscard]] bool step(const JointCommand& command, const RobotState& state, std::span<const ContactPoint> points);

  // The force at points[index] in the last step, on the link, mean over the step. [N], frame W.
  [[nodiscard]] Eigen::Vector3d contact_force(std::size_t index) const;
  void read_torques(Eigen::VectorXd& torques) const;  // of the law in the last step

 private:
  struct Law {                      // of one joint in the coming step, as in backends/physics_backend.h
    double drive = 0.0;             // t0 [N m]
    double implicit_inertia = 0.0;  // s - armature [kg m^2]
    double torque = 0.0;            // [N m]
  };

  void build(const Scene& scene);
  void build_link(const RobotModel& robot, int index);
  void set_law(const JointCommand& command, const RobotState& state);
  void use_law();
  [[nodiscard]] bool forces_are_sensible() const;
  [[nodiscard]] bool velocities_are_sensible() const;
  bool saturate();
  void find_torques();
  bool move();
  void limit_joints();

  std::shared_ptr<const RobotModel> robot_;
  double dt_;
  std::shared_ptr<dart::dynamics::Skeleton> skeleton_;
  dart::dynamics::FreeJoint* base_ = nullptr;
  std::vector<ImplicitHinge*> hinges_;
  std::vector<dart::dynamics::BodyNode*> bodies_;
  std::shared_ptr<ContactRows> rows_;
  std::unique_ptr<GroupSolver> solver_;
  std::vector<Law> law_;
  std::vector<int> stops_;  // joints that the step would bring past a stop
};

}  // namespace duet
