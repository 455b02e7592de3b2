#include "duet/robots/origin.h"

#include <algorithm>

namespace duet {

RobotModel with_origin_at(RobotModel robot, const Eigen::Vector3d& p_B) {
  robot.links.front().com -= p_B;
  for (std::size_t i = 1; i < robot.links.size(); ++i)
    if (robot.links[i].parent == 0) robot.links[i].X_PL.p -= p_B;
  for (RobotFrame& frame : robot.frames)
    if (frame.link == 0) frame.X_LF.p -= p_B;
  for (RobotShape& shape : robot.shapes)
    if (shape.link == 0) shape.X_LS.p -= p_B;
  robot.standing_height += p_B.z();
  return robot;
}

Eigen::Vector3d urdf_origin(const RobotModel& robot) {
  const auto base = std::ranges::find(robot.frames, robot.links.front().name, &RobotFrame::name);
  return base == robot.frames.end() || base->link != 0 ? Eigen::Vector3d::Zero() : base->X_LF.p;
}

}  // namespace duet
