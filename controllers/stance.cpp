#include "duet/controllers/stance.h"

#include <algorithm>

#include "duet/core/require.h"

namespace duet {
namespace {

Leg leg_to(const RobotModel& robot, int link) {
  Leg leg{.link = link, .joints = {}};
  for (int i = link; i > 0; i = robot.links[i].parent) leg.joints.insert(leg.joints.begin(), i - 1);
  return leg;
}

}  // namespace

Stance::Stance(const RobotModel& robot) : feet_(robot.feet) {
  require(!feet_.empty(), "robot '{}' has no soles in its card: it cannot be kept upright", robot.name);
  std::vector<bool> carries(robot.joints.size(), false);
  for (const int shape : feet_) {
    const int link = robot.shapes[shape].link;
    require(link > 0, "robot '{}' has soles at its base '{}', expected at the ends of legs", robot.name,
            robot.links[0].name);
    if (std::ranges::any_of(legs_, [link](const Leg& leg) { return leg.link == link; })) continue;
    legs_.push_back(leg_to(robot, link));
    for (const int joint : legs_.back().joints) carries[joint] = true;
  }
  for (int joint = 0; joint < robot.dof(); ++joint)
    if (!carries[joint]) upper_.push_back(joint);
}

void Stance::points_of(const Kinematics& kinematics, Eigen::Ref<Eigen::Matrix3Xd> p_W) const {
  for (int i = 0; i < points(); ++i) {
    p_W.col(i) = kinematics.shape_position(feet_[i]);
    p_W(2, i) -= kinematics.model().shapes[feet_[i]].radius;
  }
}

void Stance::jacobian_of(const Kinematics& kinematics, const Eigen::Matrix3Xd& p_W,
                         Eigen::Ref<Eigen::MatrixXd> J) const {
  for (int i = 0; i < points(); ++i)
    kinematics.point_jacobian(kinematics.model().shapes[feet_[i]].link, p_W.col(i), J.middleRows<3>(3 * i));
}

}  // namespace duet
