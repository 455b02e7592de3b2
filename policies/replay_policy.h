// Knows the episode's reference motion in advance and returns it: the upper bound that hindsight gives to the chain of
// anchors, scheduler and controller.
#pragma once

#include "core/robot_motion.h"
#include "policies/policy.h"

namespace duet {

class ReplayPolicy final : public Policy {
 public:
  // Throws std::invalid_argument without a robot.
  explicit ReplayPolicy(std::shared_ptr<const RobotModel> robot);
  [[nodiscard]] std::string_view name() const override { return "replay"; }
  // Copies the hindsight. Throws std::invalid_argument where there is none, where it has no frames, is not at 50 Hz or
  // its joints are not the robot's.
  void reset(const EpisodeContext& context) override;
  // The last frame stands for everything after it.
  Anchors act(const Observation& observation) override;

 private:
  std::shared_ptr<const RobotModel> robot_;  // shared with the backend and the controller of the same episode
  RobotMotion motion_;
};

}  // namespace duet
