#include "duet/retarget/upright_chain.h"

#include <algorithm>

#include "duet/core/require.h"
#include "duet/robots/roles.h"

namespace duet {
namespace {

constexpr double kMostTilt = 0.6;  // forward and back, where the card has no bounds [rad]

ChainJoint tilt_joint(const RobotModel& robot) {
  ChainJoint tilt;
  tilt.axis = 1;
  tilt.lower = robot.root_bounds ? robot.root_bounds->min_pitch : -kMostTilt;
  tilt.upper = robot.root_bounds ? robot.root_bounds->max_pitch : kMostTilt;
  return tilt;
}

// The point on what remains of the robot, or -1 as its link where it moves with the legs. The origin of the first link
// of a leg does not.
ChainPoint kept_point(const PairChain& whole, const ChainPoint& point, const std::vector<int>& link_of) {
  if (link_of[point.link] >= 0) return {link_of[point.link], point.offset};
  const ChainJoint& joint = whole.joints[point.link - 1];
  if (link_of[joint.parent] >= 0 && point.offset.norm() < 1e-9) return {link_of[joint.parent], joint.offset};
  return {-1, Eigen::Vector3d::Zero()};
}

}  // namespace

UprightChain make_upright_chain(const RobotModel& robot, const PairChain& whole) {
  const std::vector<int> legs = leg_joints(robot);
  require(!legs.empty() && soles_of_feet(robot).size() == 2,
          "robot '{}': to stand on the ground, retargeting needs 'legs' and the soles of two feet in its "
          "card; take mode=paper for a robot without",
          robot.name);
  UprightChain out;
  out.chain.joints.push_back(tilt_joint(robot));
  out.robot_joint.push_back(-1);
  std::vector<int> link_of(robot.links.size(), -1);
  link_of[0] = 1;
  for (int j = 0; j < whole.dof(); ++j) {
    const int parent = link_of[whole.joints[j].parent];
    if (parent < 0 || std::find(legs.begin(), legs.end(), j) != legs.end()) continue;
    out.chain.joints.push_back(whole.joints[j]);
    out.chain.joints.back().parent = parent;
    out.robot_joint.push_back(j);
    link_of[j + 1] = out.chain.dof();
  }
  std::vector<int> point_of(whole.points.size(), -1);
  for (std::size_t i = 0; i < whole.points.size(); ++i) {
    const ChainPoint kept = kept_point(whole, whole.points[i], link_of);
    if (kept.link < 0) continue;
    point_of[i] = static_cast<int>(out.chain.points.size());
    out.chain.points.push_back(kept);
  }
  for (const int point : whole.pair_points) out.chain.pair_points.push_back(point_of[point]);
  for (const int point : whole.key_points) {
    require(point_of[point] >= 0,
            "robot '{}': an interaction keypoint lies on a leg below the hip; mode=grounded has no place "
            "for it",
            robot.name);
    out.chain.key_points.push_back(point_of[point]);
  }
  out.chain.key_smpl = whole.key_smpl;
  out.chain.key_weight = whole.key_weight;
  out.chain.key_object = whole.key_object;
  return out;
}

}  // namespace duet
