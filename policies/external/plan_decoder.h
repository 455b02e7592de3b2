// The numbers that a policy of a descriptor answers with -> references at 50 Hz. Immutable, thread-safe.
#pragma once

#include <memory>
#include <span>
#include <string>
#include <vector>

#include "duet/policies/external/descriptor.h"
#include "duet/policies/policy.h"

namespace duet {

struct DecodedPlan {
  std::vector<Reference> references;  // at now + {0, 1, ...} ticks; empty where the numbers are no plan
  std::string fault;                  // why: place, expected, found
};

class PlanDecoder {
 public:
  // Throws InputError (file, line) where scale or offset are neither one number nor one for each of an anchor's.
  PlanDecoder(const PolicyDescriptor& descriptor, std::shared_ptr<const RobotModel> robot, std::vector<int> joints);
  [[nodiscard]] int size() const { return format_.anchors * anchor_size(); }  // numbers of a plan
  [[nodiscard]] int anchor_size() const { return kPlanNumbersBeforeJoints + static_cast<int>(joints_.size()); }
  // `numbers`: anchor by anchor. `now`: the robot as it was observed. Quaternions are made unit, joints clamped to
  // their limits. Between anchors as densify: positions and joints linear, rotation slerp.
  [[nodiscard]] DecodedPlan decode(std::span<const float> numbers, const RobotState& now) const;

 private:
  [[nodiscard]] std::string fault_of(std::span<const float> numbers) const;
  [[nodiscard]] double meant(std::span<const float> numbers, int anchor, int i) const;
  [[nodiscard]] Reference anchor(std::span<const float> numbers, int anchor, const RobotState& now) const;
  [[nodiscard]] Eigen::Quaterniond rotation(std::span<const float> numbers, int anchor) const;

  PlanFormat format_;
  std::shared_ptr<const RobotModel> robot_;
  std::vector<int> joints_;
};

// The anchors among `references`, of which the last one stands for what follows. Throws std::invalid_argument for none.
Anchors anchors_of(const std::vector<Reference>& references);

}  // namespace duet
