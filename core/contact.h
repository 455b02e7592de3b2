// Contacts of the robot with the ground, the human partner and itself, in one sign convention for every engine.
#pragma once

#include <Eigen/Core>

namespace duet {

enum class ContactSide { kGround, kHuman, kRobot };

struct Contact {
  int link = -1;                                   // robot link that is touched (index in RobotModel::links)
  ContactSide side = ContactSide::kGround;         // what touches it
  int other = -1;                                  // capsule of the human or link of the robot; -1 for the ground
  Eigen::Vector3d p_WC = Eigen::Vector3d::Zero();  // contact point [m]
  Eigen::Vector3d f_W =
      Eigen::Vector3d::Zero();  // force of the other side on the link, mean over the last step, at C [N]
  double depth = 0.0;           // penetration, >= 0 [m]
};

}  // namespace duet
