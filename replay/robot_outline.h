// The look of a robot whose card has only shapes for contact: feet over the soles, blocks where limbs meet, and
// bars over the gaps between shapes. For drawing alone; no engine and no metric sees it.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "duet/robots/robot_model.h"

namespace duet {

struct OutlineSphere {
  Eigen::Vector3d center = Eigen::Vector3d::Zero();  // in the axes of its link [m]
  double radius = 0.0;                               // [m]
};

// The convex hull of spheres that one link carries.
struct OutlineHull {
  int link = 0;
  std::vector<OutlineSphere> spheres;
  std::vector<int> shapes;  // of the robot, that lie inside it
  bool is_foot = false;
};

// A capsule from a point of one link to a point of another.
struct OutlineBar {
  int from_link = 0, to_link = 0;
  Eigen::Vector3d from = Eigen::Vector3d::Zero(), to = Eigen::Vector3d::Zero();  // in the axes of their links [m]
  double radius = 0.0;                                                           // [m]
};

struct RobotOutline {
  std::vector<OutlineHull> hulls;
  std::vector<OutlineBar> bars;
};

// Hulls: of each link with soles, up to its joint and never below the soles; and of each link at which at least two
// others hang, from its own joint to theirs. Bars join what is left to what it hangs from, so that the body is in one
// piece. Empty for a robot without shapes.
RobotOutline robot_outline(const RobotModel& robot);

}  // namespace duet
