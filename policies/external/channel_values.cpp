#include "duet/policies/external/channel_values.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "duet/core/names.h"
#include "duet/core/require.h"
#include "duet/core/robot_state.h"
#include "duet/io/channel.h"
#include "duet/policies/dstar/features.h"
#include "duet/policies/language.h"
#include "duet/policies/scheduler.h"

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

namespace {

constexpr double kLeastQuaternion = 1e-3;  // norm; below it the direction is noise

double at(const std::vector<double>& values, int i) { return values.size() == 1 ? values[0] : values[i]; }

void check_count(const PolicyDescriptor& descriptor, const char* key, const std::vector<double>& values, int size) {
  if (values.size() != 1 && static_cast<int>(values.size()) != size)
    throw InputError(fmt::format("{}:{}: output: '{}': expected 1 or {} numbers, found {}", descriptor.file,
                                 descriptor.output.line, key, size, values.size()));
}

Pose in_world(PlanFrame frame, const Pose& X_FB, const RobotState& now) {
  if (frame == PlanFrame::kEgo) return ego_frame(now) * X_FB;
  if (frame == PlanFrame::kDisplacement) return {X_FB.R, now.X_WB.p + X_FB.p};
  return X_FB;
}

}  // namespace

PlanDecoder::PlanDecoder(const PolicyDescriptor& descriptor, std::shared_ptr<const RobotModel> robot,
                         std::vector<int> joints)
    : format_(descriptor.output), robot_(std::move(robot)), joints_(std::move(joints)) {
  check_count(descriptor, "scale", format_.scale, anchor_size());
  check_count(descriptor, "offset", format_.offset, anchor_size());
}

DecodedPlan PlanDecoder::decode(std::span<const float> numbers, const RobotState& now) const {
  DecodedPlan decoded{.references = {}, .fault = fault_of(numbers)};
  if (!decoded.fault.empty()) return decoded;
  std::vector<Reference> anchors;
  anchors.reserve(format_.anchors);
  for (int i = 0; i < format_.anchors; ++i) anchors.push_back(anchor(numbers, i, now));
  if (format_.anchors == 1 || format_.ticks_per_anchor == 1) {
    decoded.references = std::move(anchors);
    return decoded;
  }
  const int ticks = format_.ticks_per_anchor, count = (format_.anchors - 1) * ticks;
  decoded.references.reserve(count);
  for (int i = 0; i < count; ++i)
    decoded.references.push_back(
        interpolate(anchors[i / ticks], anchors[i / ticks + 1], static_cast<double>(i % ticks) / ticks));
  return decoded;
}

std::string PlanDecoder::fault_of(std::span<const float> numbers) const {
  if (static_cast<int>(numbers.size()) != size())
    return fmt::format("plan: expected {} numbers ({} anchors of {}), found {}", size(), format_.anchors, anchor_size(),
                       numbers.size());
  for (int a = 0; a < format_.anchors; ++a) {
    for (int i = 0; i < anchor_size(); ++i)
      if (const double value = meant(numbers, a, i); !std::isfinite(value))
        return fmt::format("plan: anchor {}, number {}: expected a finite number, found {}", a, i, value);
    if (const double norm = rotation(numbers, a).norm(); !(norm >= kLeastQuaternion))
      return fmt::format("plan: anchor {}: expected a unit quaternion, found one of length {}", a, norm);
  }
  return "";
}

double PlanDecoder::meant(std::span<const float> numbers, int anchor, int i) const {
  return numbers[anchor * anchor_size() + i] * at(format_.scale, i) + at(format_.offset, i);
}

Eigen::Quaterniond PlanDecoder::rotation(std::span<const float> numbers, int anchor) const {
  return {meant(numbers, anchor, 3), meant(numbers, anchor, 4), meant(numbers, anchor, 5), meant(numbers, anchor, 6)};
}

Reference PlanDecoder::anchor(std::span<const float> numbers, int anchor, const RobotState& now) const {
  const Pose X_FB{rotation(numbers, anchor).normalized(),
                  {meant(numbers, anchor, 0), meant(numbers, anchor, 1), meant(numbers, anchor, 2)}};
  Reference reference{in_world(format_.frame, X_FB, now), Eigen::VectorXd(robot_->dof())};
  for (std::size_t i = 0; i < joints_.size(); ++i) {
    const RobotJoint& joint = robot_->joints[joints_[i]];
    const double zero = format_.joints_from_neutral ? robot_->neutral[joints_[i]] : 0.0;
    reference.q[joints_[i]] = std::clamp(zero + meant(numbers, anchor, kPlanNumbersBeforeJoints + static_cast<int>(i)),
                                         joint.lower, joint.upper);
  }
  return reference;
}

Anchors anchors_of(const std::vector<Reference>& references) {
  require(!references.empty(), "anchors: expected references, found none");
  Anchors anchors;
  for (int i = 0; i < kAnchors; ++i)
    anchors[i] = references[std::min<std::size_t>(i * kTicksPerAnchor, references.size() - 1)];
  return anchors;
}

}  // namespace duet
