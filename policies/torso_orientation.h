// Waist angles that turn the torso as asked: what is left to a robot whose pelvis has to stand upright. Thread-safe.
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <vector>

#include "robots/robot_model.h"

namespace duet {

class TorsoOrientation {
 public:
  // The waist: joints named "waist..." or "torso..." of `robot`. There may be none.
  explicit TorsoOrientation(const RobotModel& robot);

  // Orientation of the link above the last waist joint in the base frame, R_BT.
  [[nodiscard]] Eigen::Quaterniond at(const Eigen::VectorXd& q) const;
  // Sets the waist joints of `q`, inside their limits, to bring at(q) as near to R_BT as they can (smallest angle);
  // starts from those in `q` and is made for goals within a right angle of at(q): from further away, or where the way
  // there leads through a limit of the yaw, it may end at a worse answer. A continuous function of both as long as
  // there is one best answer.
  void solve(const Eigen::Quaterniond& R_BT, Eigen::VectorXd& q) const;

 private:
  struct Hinge {
    Eigen::Quaterniond R_PL;
    Eigen::Vector3d axis;
    int joint;
    bool waist;  // free to move in solve()
    double lower, upper;
  };
  std::vector<Hinge> chain_;  // from the base to the torso
};

}  // namespace duet
