// Which joint of a robot each column of a file is. Pure function.
#pragma once

#include <Eigen/Core>
#include <string>
#include <vector>

#include "duet/robots/robot_model.h"

namespace duet {

// Indices in RobotModel::joints of the file's columns in either order (the same where the file names them); -1 where
// the robot lacks one.
struct ColumnBinding {
  std::vector<int> depth_first = {}, breadth_first = {};
  std::vector<std::string> evidence = {};
};

// Binds by name where there are `names`, with or without "_joint"; else as many columns as the robot has joints, or
// joints without its wrists. Throws InputError naming `path`: another number of columns, a joint that stands twice,
// less than half of the robot's joints.
ColumnBinding bind_columns(const std::string& path, const std::vector<std::string>& names, Eigen::Index columns,
                           const RobotModel& robot);

}  // namespace duet
