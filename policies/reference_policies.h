// Two policies that learn nothing: one knows the motion in advance, one stands still.
#pragma once

#include "duet/core/recording.h"
#include "duet/policies/policy.h"

namespace duet {

// Knows the episode's reference motion in advance and returns it: the upper bound that hindsight gives to the chain of
// anchors, scheduler and controller.

class ReplayPolicy : public Policy {
 public:
  // Throws std::invalid_argument without a robot.
  explicit ReplayPolicy(std::shared_ptr<const RobotModel> robot);
  [[nodiscard]] std::string_view name() const override { return "replay"; }
  // Copies the hindsight. Throws std::invalid_argument where there is none, where it has no frames, is not at 50 Hz or
  // its joints are not the robot's.
  void reset(const EpisodeContext& context) override;
  // The last frame stands for everything after it.
  Anchors act(const Observation& observation) override;

 protected:
  // The motion at `tick`. Throws std::invalid_argument before reset.
  [[nodiscard]] Reference at(int tick) const;

 private:
  std::shared_ptr<const RobotModel> robot_;  // shared with the backend and the controller of the same episode
  RobotMotion motion_;
};

// The same motion at 50 Hz, without the loss of the anchors.
class DenseReplayPolicy final : public ReplayPolicy {
 public:
  using ReplayPolicy::ReplayPolicy;
  [[nodiscard]] std::string_view name() const override { return "replay_dense"; }
  std::vector<Reference> plan(const Observation& observation) override;
};

// The control arm (docs/architecture.md, 6): stands where it is, in the neutral pose, whatever the partner does.
class NullPolicy final : public Policy {
 public:
  // Throws std::invalid_argument without a robot.
  explicit NullPolicy(std::shared_ptr<const RobotModel> robot);
  [[nodiscard]] std::string_view name() const override { return "null"; }
  void reset(const EpisodeContext& context) override;
  Anchors act(const Observation& observation) override;

 private:
  std::shared_ptr<const RobotModel> robot_;  // shared with the backend and the controller of the same episode
  Anchors anchors_;
};

}  // namespace duet
