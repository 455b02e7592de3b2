// The control arm (docs/architecture.md, 6): stands where it is, in the neutral pose, whatever the partner does.
#pragma once

#include "duet/policies/policy.h"

namespace duet {

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
