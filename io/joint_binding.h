// Joints that a file names, found in a robot by their names.
#pragma once

#include <span>
#include <string>
#include <vector>

#include "duet/robots/robot_model.h"

namespace duet {

struct JointBinding {
  std::vector<int> indices;          // in the robot, in the file's order; -1: the robot lacks it
  std::vector<std::string> absent;   // named, but not the robot's
  std::vector<std::string> unnamed;  // the robot's, but not named
};

JointBinding bind_by_name(std::span<const std::string> names, const RobotModel& robot);

}  // namespace duet
