// The numbers that channels of a policy descriptor show, for a robot with its joints in the descriptor's order. One
// owner, not thread-safe.
#pragma once

#include <memory>
#include <span>
#include <vector>

#include "duet/core/random.h"
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

}  // namespace duet
