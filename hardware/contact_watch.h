// Whether somebody is touched or pressed, from the torques that the arms' joints report beyond those of the model. One
// owner, one thread; no allocation after construction.
#pragma once

#include <memory>
#include <vector>

#include "duet/hardware/body_distance.h"
#include "duet/hardware/limits.h"
#include "duet/metrics/contact_limits.h"
#include "duet/robots/dynamics.h"

namespace duet {

struct ContactReading {
  bool touch = false;    // an arm has been pushed for HardwareLimits::contact_time
  bool release = false;  // a joint or the force of both arms together is past its share: the arms have to open
  double force = 0.0;    // of both arms together, estimated [N]
};

class ContactWatch {
 public:
  // `least_force`: the lowest limit of the regions that the task may touch [N]; 0 where none may be: the force then
  // releases nothing and a touch does. `dt` of a tick [s]. Throws std::invalid_argument for no robot, for a robot whose
  // card names no arms, for a dt that is not positive and a force below 0.
  ContactWatch(std::shared_ptr<const RobotModel> robot, const HardwareLimits& limits, double least_force, double dt);

  // `tau`: of all joints as measured [N m]. Both finite and of the robot's size.
  ContactReading update(const RobotState& state, const Eigen::VectorXd& tau);

 private:
  [[nodiscard]] double threshold(int joint) const;

  std::shared_ptr<const RobotModel> robot_;
  HardwareLimits limits_;
  double least_force_;
  int ticks_to_count_;
  Dynamics dynamics_;
  RobotState still_;
  Eigen::VectorXd bias_;
  std::vector<bool> is_wrist_;  // of each joint
  std::vector<int> ticks_;      // of each joint past its threshold, in a row
};

// The lowest quasi-static force of the regions of a person that `touches` name; 0 where there are none.
double least_touch_force(const std::vector<TouchPair>& touches, const ContactLimits& limits);

}  // namespace duet
