// The reference that WBC-Sim tracks, once per tick: the 36-D reference u_t with its legs replaced by steps. Both the
// controller and the training environment use it, so that a policy sees in a rollout what it saw in training. No
// allocation after construction.
#pragma once

#include <Eigen/Core>
#include <array>
#include <memory>

#include "duet/controllers/wbc_sim/gait.h"
#include "duet/controllers/wbc_sim/leg_chain.h"
#include "duet/core/robot_state.h"
#include "duet/robots/robot_model.h"

namespace duet {

class WbcTracker {
 public:
  // Bounds of the root's reference and the width of the stance are the card's; what is beyond a bound is tracked at the
  // bound. The width of `gait` is not looked at. Throws std::invalid_argument for a robot that has not two legs of six
  // joints or whose card lacks either.
  explicit WbcTracker(std::shared_ptr<const RobotModel> robot, const GaitOptions& gait = {});

  // Starts at a reference; velocities are zero until the next update.
  void reset(const Reference& reference);
  // One tick of 0.02 s: sizes are not checked.
  void update(const RobotState& state, const Reference& reference);

  [[nodiscard]] const Pose& root() const { return root_; }       // within the bounds, in W
  [[nodiscard]] const Eigen::VectorXd& q() const { return q_; }  // upper body of u_t, legs of the gait [rad]
  [[nodiscard]] const Eigen::VectorXd& v() const { return v_; }  // its rate [rad/s]
  [[nodiscard]] const Eigen::Vector3d& root_velocity() const {
    return root_velocity_;
  }  // vx, vy, yaw rate; heading frame
  // root() as it will be after the gait's lead time.
  [[nodiscard]] Pose led_root() const;
  [[nodiscard]] const Gait& gait() const { return gait_; }
  [[nodiscard]] const RobotModel& robot() const { return *robot_; }
  [[nodiscard]] const std::array<LegChain, 2>& legs() const { return legs_; }  // left, right
  [[nodiscard]] const std::vector<int>& upper() const { return upper_; }       // the other joints
  [[nodiscard]] double ankle_height() const { return ankle_height_; }          // of a standing foot's link [m]
  [[nodiscard]] double foot_x() const { return foot_x_; }                      // of that link ahead of the pelvis [m]

 private:
  void track(const Reference& reference);

  std::shared_ptr<const RobotModel> robot_;
  RootBounds bounds_;
  Gait gait_;
  std::array<LegChain, 2> legs_;
  std::vector<int> upper_;
  double ankle_height_ = 0.0, foot_x_ = 0.0;
  Pose root_, last_root_;
  Eigen::VectorXd q_, v_, last_q_;
  Eigen::Vector3d root_velocity_ = Eigen::Vector3d::Zero();
};

}  // namespace duet
