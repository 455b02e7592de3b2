// A robot without physics: it is where its reference says.
#pragma once

#include "duet/core/robot_state.h"

namespace duet {

// A robot that is put where a reference says. Its velocities are those of the way there, zero for the first.
class KinematicFollower {
 public:
  KinematicFollower() = default;
  explicit KinematicFollower(const RobotState& start) : state_(start) {}
  // `seconds` after the last one, above 0.
  void go_to(const Reference& reference, double seconds);
  [[nodiscard]] const RobotState& state() const { return state_; }

 private:
  RobotState state_;
  bool moved_ = false;
};

}  // namespace duet
