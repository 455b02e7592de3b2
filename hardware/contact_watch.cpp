#include "duet/hardware/contact_watch.h"

#include <algorithm>
#include <cmath>

#include "duet/core/require.h"

namespace duet {
namespace {

const RobotModel& with_arms(const std::shared_ptr<const RobotModel>& robot) {
  require(robot != nullptr, "contact watch: expected a robot, found none");
  require(!robot->roles.arms[0].empty() && !robot->roles.arms[1].empty(),
          "contact watch: expected a card with two arms, found none in '{}'", robot->name);
  return *robot;
}

}  // namespace

ContactWatch::ContactWatch(std::shared_ptr<const RobotModel> robot, const HardwareLimits& limits, double least_force,
                           double dt)
    : robot_(std::move(robot)),
      limits_(limits),
      least_force_(least_force),
      ticks_to_count_(static_cast<int>(std::ceil(limits.contact_time / dt - 1e-9))),
      dynamics_(with_arms(robot_)) {
  require(dt > 0.0, "contact watch: expected a dt above 0 s, found {}", dt);
  require(least_force >= 0.0, "contact watch: expected a force of at least 0 N, found {}", least_force);
  bias_.setZero(6 + robot_->dof());
  still_.v.setZero(robot_->dof());
  still_.q.setZero(robot_->dof());
  is_wrist_.assign(robot_->joints.size(), false);
  for (const int joint : robot_->roles.wrists) is_wrist_[joint] = true;
  ticks_.assign(robot_->joints.size(), 0);
}

double ContactWatch::threshold(int joint) const {
  return is_wrist_[joint] ? limits_.wrist_torque : limits_.shoulder_torque;
}

ContactReading ContactWatch::update(const RobotState& state, const Eigen::VectorXd& tau) {
  still_.X_WB = state.X_WB;
  still_.q = state.q;
  dynamics_.bias_forces(still_, bias_);  // of gravity: arms move slowly
  ContactReading reading;
  for (const std::vector<int>& arm : robot_->roles.arms) {
    double largest = 0.0;
    for (const int joint : arm) {
      const double beyond = std::abs(tau[joint] - bias_[6 + joint]);
      ticks_[joint] = beyond > threshold(joint) ? ticks_[joint] + 1 : 0;
      reading.touch = reading.touch || ticks_[joint] >= ticks_to_count_;
      if (ticks_[joint] < ticks_to_count_) continue;
      if (!is_wrist_[joint]) largest = std::max(largest, beyond);
      reading.release = reading.release || std::abs(tau[joint]) > limits_.release_effort * robot_->joints[joint].effort;
    }
    reading.force += largest / limits_.contact_lever;
  }
  const bool too_much = least_force_ > 0.0 ? reading.force > limits_.release_force * least_force_ : reading.touch;
  reading.release = reading.release || too_much;
  return reading;
}

double least_touch_force(const std::vector<TouchPair>& touches, const ContactLimits& limits) {
  double least = 0.0;
  for (const TouchPair& touch : touches) {
    const RegionLimits& region = limits.region(touch.human);
    require(region.quasi_static_n.has_value(), "contact limits of region '{}': expected quasi_static_n, found none",
            touch.human);
    least = least == 0.0 ? *region.quasi_static_n : std::min(least, *region.quasi_static_n);
  }
  return least;
}

}  // namespace duet
