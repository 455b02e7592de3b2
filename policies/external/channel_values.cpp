#include "duet/policies/external/channel_values.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "duet/core/clock.h"
#include "duet/core/names.h"
#include "duet/core/require.h"
#include "duet/io/joint_binding.h"
#include "duet/policies/dstar/features.h"
#include "duet/policies/language.h"

namespace duet {
namespace {

static_assert(kPromptNumbers == kLanguageSize);

double at(const std::vector<double>& values, std::size_t i) { return values.size() == 1 ? values[0] : values[i]; }

}  // namespace

std::vector<int> bind_joints(const PolicyDescriptor& descriptor, const RobotModel& robot) {
  const std::vector<std::string> known = robot.joint_names();
  const std::vector<std::string>& names = descriptor.joints.empty() ? known : descriptor.joints;
  const auto refuse = [&](const std::string& message) {
    throw InputError(fmt::format("{}:{}: 'joints' with robot '{}': {}", descriptor.file, descriptor.joints_line,
                                 robot.name, message));
  };
  JointBinding bound = bind_by_name(names, robot);
  if (!bound.absent.empty()) refuse(unknown_name_message("joint", bound.absent[0], known));
  if (!bound.unnamed.empty())
    refuse(fmt::format("expected its {} joints, found none '{}'", known.size(), bound.unnamed[0]));
  return std::move(bound.indices);
}

ChannelValues::ChannelValues(std::shared_ptr<const RobotModel> robot, std::vector<int> joints,
                             const PolicyDescriptor& descriptor)
    : robot_(std::move(robot)), joints_(std::move(joints)), frame_(descriptor.frame), tasks_(descriptor.tasks) {}

void ChannelValues::reset(const EpisodeContext& context, std::vector<float> language) {
  start_ = context.start.X_WB.p;
  task_ = context.task;
  language_ = std::move(language);
  noise_ = Random(context.seed, stream_key({"policy", "noise"}));
}

void ChannelValues::write(const Channel& channel, const Observation& observation, int frame, std::span<float> out) {
  write_plain(channel.kind, observation, frame, out);
  for (std::size_t i = 0; i < out.size(); ++i)
    out[i] = static_cast<float>((out[i] - at(channel.shift, i)) * at(channel.scale, i));
}

void ChannelValues::write_plain(ChannelKind kind, const Observation& observation, int frame, std::span<float> out) {
  switch (kind) {
    case ChannelKind::kLanguage:
      std::ranges::copy(language_, out.begin());
      return;
    case ChannelKind::kTask:
      std::ranges::transform(tasks_, out.begin(), [this](Task task) { return task == task_ ? 1.0F : 0.0F; });
      return;
    case ChannelKind::kTime:
      out[0] = static_cast<float>(observation.tick * kTick);
      return;
    case ChannelKind::kNoise:
      for (float& number : out) number = static_cast<float>(noise_.normal());
      return;
    default:
      ChannelWriter writer(out);
      senses_of(observation, frame).show(kind, writer);
  }
}

FrameSenses ChannelValues::senses_of(const Observation& observation, int frame) const {
  const ObservationFrame& seen = observation.history[static_cast<std::size_t>(frame)];
  if (frame_ == PolicyFrame::kWorld) return FrameSenses::in_world(seen, *robot_, joints_, start_);
  return FrameSenses::in_ego(seen, *robot_, joints_, ego_frame(observation.now().robot).inverse());
}

}  // namespace duet
