// A robot's motion over time at a fixed rate: what PAIR produces, what motion files hold, what playback plays.
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <string>
#include <vector>

#include "duet/core/robot_state.h"

namespace duet {

struct RobotMotion {
  double rate_hz = 50.0;
  std::vector<std::string> joint_names;  // names of the columns of q
  std::vector<Pose> root;                // X_WB per frame, T entries
  Eigen::MatrixXd q;                     // (joints, T) [rad]; one column is one frame

  [[nodiscard]] int frames() const { return static_cast<int>(root.size()); }
  [[nodiscard]] Reference reference(int frame) const { return {root[frame], q.col(frame)}; }
};

// Throws std::invalid_argument naming what is wrong: sizes that disagree, a value that is not finite, a quaternion that
// is not unit (to 1e-6), a rate that is not positive. `what` names the motion in the message.
void validate(const RobotMotion& motion, const std::string& what);

// At another rate, first instant kept: positions and angles linear, rotations slerp; frames are never skipped. Throws
// std::invalid_argument for a motion without frames or a rate that is not positive.
RobotMotion resample(const RobotMotion& motion, double rate_hz);

}  // namespace duet
