// Waist angles that turn the torso as asked: what is left to a robot whose pelvis has to stand upright. Thread-safe.
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <vector>

#include "duet/robots/robot_model.h"

namespace duet {

class TorsoOrientation {
 public:
  // The waist is the card's; there may be none. It stands between pelvis and trunk, either of which may be the base.
  explicit TorsoOrientation(const RobotModel& robot);

  // Orientation of the trunk in the pelvis, R_PT: of the link above the last waist joint in the base, or where the
  // waist is below the base, of the base in the link below it.
  [[nodiscard]] Eigen::Quaterniond at(const Eigen::VectorXd& q) const;
  // Sets the waist joints of `q`, inside their limits, to bring at(q) as near to R_PT as they can (smallest angle);
  // starts from those in `q` and is made for goals within a right angle of at(q): from further away, or where the way
  // there leads through a limit of the yaw, it may end at a worse answer. A continuous function of both as long as
  // there is one best answer.
  void solve(const Eigen::Quaterniond& R_PT, Eigen::VectorXd& q) const;

 private:
  void turn_round();

  struct Hinge {
    Eigen::Quaterniond R_before;  // from the frame that is nearer to the pelvis to that of the hinge
    Eigen::Vector3d axis;
    int joint;
    bool waist;  // free to move in solve()
    double lower, upper;
  };
  std::vector<Hinge> chain_;                                   // from the pelvis to the trunk
  Eigen::Quaterniond R_end_ = Eigen::Quaterniond::Identity();  // of the trunk in the frame of the last hinge
};

}  // namespace duet
