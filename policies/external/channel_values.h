// The numbers that channels of a policy descriptor show, for a robot with its joints in the descriptor's order. One
// owner, not thread-safe.
#pragma once

#include <memory>
#include <span>
#include <string>
#include <vector>

#include "duet/core/numbers.h"
#include "duet/policies/external/descriptor.h"
#include "duet/policies/policy.h"

namespace duet {

// Indices of the robot's joints in the descriptor's order. Throws InputError where they are not the robot's: file,
// line, a joint that one of the two lacks.
std::vector<int> bind_joints(const PolicyDescriptor& descriptor, const RobotModel& robot);

class ChannelValues {
 public:
  ChannelValues(std::shared_ptr<const RobotModel> robot, std::vector<int> joints, const PolicyDescriptor& descriptor);
  // `language`: the prompt's embedding, where a channel shows it.
  void reset(const EpisodeContext& context, std::vector<float> language);
  // Writes frame `frame` (0 the oldest) of the observation and its tick. `out` has channel_size numbers. No allocation.
  void write(const Channel& channel, const Observation& observation, int frame, std::span<float> out);

 private:
  void write_plain(ChannelKind kind, const Observation& observation, int frame, std::span<float> out);
  [[nodiscard]] FrameSenses senses_of(const Observation& observation, int frame) const;

  std::shared_ptr<const RobotModel> robot_;
  std::vector<int> joints_;
  PolicyFrame frame_;
  std::vector<Task> tasks_;  // of the descriptor
  Eigen::Vector3d start_ = Eigen::Vector3d::Zero();
  Task task_ = Task::kHug;  // of the episode, since reset
  std::vector<float> language_;
  Random noise_{0, 0};
};

// The numbers that a policy of a descriptor answers with -> references at 50 Hz. Immutable, thread-safe.

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
