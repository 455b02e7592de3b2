// Keeps a robot on its feet that we command joint by joint: a walking controller of controllers/, told the velocity
// that came out of the limiter. Those made from a descriptor with a `command` (HOMIE) are told it as it is; others
// (WBC-Sim) follow a root that moves at it. It moves what the limiter does not: legs and waist. One owner, one
// thread.
#pragma once

#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "duet/controllers/controller.h"
#include "duet/controllers/root_conversion.h"
#include "duet/hardware/guard/goal_walk.h"
#include "duet/hardware/safety/limits.h"
#include "duet/hardware/wire/robot_wire.h"

namespace duet {

// The least speeds that a controller answers by a step, as its descriptor says them; 0 where it has none.
LeastSteps least_steps(const std::string& controller);
// Whether a controller is told velocities, as its descriptor says it.
bool is_told_velocities(const std::string& controller);

class Walker {
 public:
  // Throws as make_controller; std::invalid_argument for a controller that does not walk.
  Walker(const std::string& controller, const ControllerOptions& options,
         const std::shared_ptr<const RobotModel>& robot);
  // Makes walkers, all of the files as they are now. Throws as the constructor. Thread-safe.
  static std::function<std::unique_ptr<Walker>()> load(const std::string& controller, const ControllerOptions& options,
                                                       const std::shared_ptr<const RobotModel>& robot);

  // Begins in `state`, standing.
  void begin(const RobotState& state);
  // 50 times a second. `q`: what the joints are sent now; of those that it does not move it is the reference. Each
  // target is inside its joint's limits. Valid until the next call; no allocation after the first.
  const JointCommand& update(const RobotState& state, const VelocityCommand& velocity, const Eigen::VectorXd& q);

  [[nodiscard]] const std::string& name() const { return name_; }
  // The least speeds that it answers by a step.
  [[nodiscard]] const LeastSteps& least_steps() const { return least_; }
  [[nodiscard]] ControllerFaults faults() const { return controller_->faults(); }

 private:
  Walker(std::string name, const LeastSteps& least, std::shared_ptr<const RobotModel> robot,
         std::shared_ptr<VelocityCommand> told, std::unique_ptr<Controller> controller);
  void lead(const RobotState& state, const VelocityCommand& velocity);

  std::string name_;
  LeastSteps least_;
  std::shared_ptr<const RobotModel> robot_;
  std::shared_ptr<VelocityCommand> told_;  // null: the root that moves is what it follows
  std::unique_ptr<Controller> controller_;
  Reference reference_;
  double yaw_ = 0.0;  // of the reference's root
  JointCommand command_;
};

// From the planner's root pose to the velocity that a walking controller is told, on a robot: the law of
// hardware/guard/goal_walk.h, fed by measured odometry. No allocation.
class RootVelocity {
 public:
  // Throws std::invalid_argument where nobody measures place and speed of the root (OdometrySource::kNone).
  // `least`: of the walking controller; nothing slower is asked for where the limits allow it.
  RootVelocity(OdometrySource source, const HardwareLimits& limits, const LeastSteps& least = {});

  void reset() { law_.reset(); }
  // `reference`: pose of the root in the frame of odometry. Where the sample is invalid, not finite or older than
  // `most_age` [s], the answer is to stand, and the law begins anew with the next good one.
  VelocityCommand update(const OdometrySample& odometry, const Reference& reference, double now,
                         double most_age = SafetyRules{}.odometry.hold);

 private:
  GoalWalk law_;
  double height_;  // where it stands [m]
  RobotState state_;
};

}  // namespace duet
