// From a place and a heading to the velocities that a walking controller is told: the robot turns towards the place,
// walks there, stops short of it as supplement A.4.3 does, and turns to the heading. Nothing is asked for that the
// controller does not answer by a step, and between two bursts it comes to rest. No allocation. One owner, one thread.
#pragma once

#include "duet/controllers/root_conversion.h"
#include "duet/core/robot_state.h"
#include "duet/hardware/safety/limits.h"

namespace duet {

// The least speeds that a walking controller answers by a step, as its descriptor says them; 0 where it answers all.
struct LeastSteps {
  double forward = 0.0;  // [m/s]
  double yaw = 0.0;      // [rad/s]
};

class GoalWalk {
 public:
  // Nothing beyond `limits` is asked for.
  GoalWalk(const HardwareLimits& limits, const LeastSteps& least);

  // Begins anew, standing.
  void reset();
  // 50 times a second. `measured`: place, heading and speed of the root; `goal` in the same frame. The height is that
  // of the goal, within the limits.
  VelocityCommand update(const RobotState& measured, const Pose& goal);

 private:
  enum class Phase { kStanding, kFacing, kWalking, kBraking, kAligning, kSettling };
  // The goal as the robot sees it.
  struct Sight {
    Eigen::Vector2d residual = Eigen::Vector2d::Zero();  // of the place, in the heading frame [m]
    double bearing = 0.0;                                // of the place [rad]
    double turn = 0.0;                                   // to the goal's heading [rad]
    double speed = 0.0;                                  // forward [m/s]
  };

  static Sight sight_of(const RobotState& measured, const Pose& goal);
  void decide(const Sight& sight, const RobotState& measured, const Pose& goal);
  void enter(Phase phase);
  void face(const Sight& sight, const RobotState& measured, VelocityCommand& command);
  void walk(const Sight& sight, VelocityCommand& command);
  void brake(const Sight& sight, VelocityCommand& command);
  void align(const Sight& sight, const RobotState& measured, VelocityCommand& command);
  void turn_in_place(double error, const RobotState& measured, VelocityCommand& command);

  HardwareLimits limits_;
  LeastSteps least_;
  Phase phase_ = Phase::kStanding;
  int ticks_ = 0;      // in the phase
  int tries_ = 0;      // walks to this goal that have ended; 0: it has arrived, or has not begun
  double side_ = 1.0;  // to which it turns: 1 left, -1 right
  Eigen::Vector2d place_ = Eigen::Vector2d::Zero();  // that it keeps while it turns
};

}  // namespace duet
