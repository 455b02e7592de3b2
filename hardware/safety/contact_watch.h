// Whether somebody is touched or pressed, from the torques that the arms' joints report beyond those of the model. One
// owner, one thread; no allocation after construction.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "duet/backends/backend.h"
#include "duet/hardware/safety/limits.h"
#include "duet/metrics/contact_limits.h"
#include "duet/robots/dynamics.h"
#include "duet/robots/human_body.h"
#include "duet/robots/kinematics.h"

namespace duet {

// How far the robot's capsules are from one another and from a person's. Buffers are sized on construction: no
// allocation afterwards. One owner, one thread; what it returns depends on its arguments only.

// A part of the robot and a part of a person that may touch while a task's act lasts: regions of the card's shapes and
// of HumanCapsule.
struct TouchPair {
  std::string robot;
  std::string human;
};

// Gaps between surfaces [m], below 0 where they overlap; kFar where there is nothing to be near to.
struct BodyGaps {
  static constexpr double kFar = 1e9;
  double self = kFar;    // of the card's pairs
  double person = kFar;  // of any link and any part of the person that may not touch
  double touch = kFar;   // of those that may
  double head = kFar;    // of any link and head or neck
  int touched = -1;      // the person's capsule of `touch`
  Eigen::Vector3d head_from_robot = Eigen::Vector3d::Zero();  // unit, W: from the nearest link to the head
};

class BodyDistance {
 public:
  // Throws std::invalid_argument for a touch of a region that robot or person lacks, or of head or neck.
  BodyDistance(std::shared_ptr<const RobotModel> robot, HumanBody human, const std::vector<TouchPair>& touches);

  // Measures the robot in this pose. `person`: SMPL-24 joints in W, or null; its capsules grow by `uncertainty` [m],
  // but not where they may touch. `may_touch`: the task's act lasts.
  const BodyGaps& measure(const Pose& X_WB, const Eigen::VectorXd& q, const HumanJoints* person, double uncertainty,
                          bool may_touch);
  [[nodiscard]] const BodyGaps& gaps() const { return gaps_; }  // of the last call
  [[nodiscard]] const HumanBody& human() const { return human_; }

 private:
  struct Segment {
    Eigen::Vector3d a = Eigen::Vector3d::Zero(), b = Eigen::Vector3d::Zero();
    double radius = 0.0;
    Eigen::Vector3d center = Eigen::Vector3d::Zero();
    double reach = 0.0;  // of a sphere around it
  };
  static Segment segment(const Eigen::Vector3d& a, const Eigen::Vector3d& b, double radius);
  void place_shapes(const Pose& X_WB, const Eigen::VectorXd& q);
  void measure_person(const HumanJoints& person, double uncertainty, bool may_touch);
  void measure_capsule(const Segment& capsule, std::size_t index, double uncertainty, bool may_touch);

  std::shared_ptr<const RobotModel> robot_;
  HumanBody human_;
  Kinematics kinematics_;
  std::vector<Segment> shapes_;
  std::vector<bool> is_head_;               // of each capsule
  std::vector<std::vector<bool>> touches_;  // [capsule][shape]
  BodyGaps gaps_;
};

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
  // The generalized forces that hold the robot against gravity in the last update's pose: of the base, then of each
  // joint [N m]. Zero before the first.
  [[nodiscard]] const Eigen::VectorXd& weight() const { return bias_; }

 private:
  [[nodiscard]] double threshold(int joint) const;

  std::shared_ptr<const RobotModel> robot_;
  HardwareLimits limits_;
  double least_force_;
  int ticks_to_count_ = 1;
  Dynamics dynamics_;
  RobotState still_;
  Eigen::VectorXd bias_;
  std::vector<bool> is_wrist_;  // of each joint
  std::vector<int> ticks_;      // of each joint past its threshold, in a row
};

// The lowest quasi-static force of the regions of a person that `touches` name; 0 where there are none.
double least_touch_force(const std::vector<TouchPair>& touches, const ContactLimits& limits);

}  // namespace duet
