#include "duet/app/policy_check.h"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <numbers>

#include "duet/core/require.h"
#include "duet/core/robot_state.h"
#include "duet/motion/synthesis/synthesis.h"
#include "duet/policies/catalogue/registry.h"
#include "duet/policies/external/channel_values.h"
#include "duet/policies/external/descriptor.h"
#include "duet/policies/external/external_policy.h"
#include "duet/policies/language.h"
#include "duet/policies/policy.h"
#include "duet/retarget/solver/pair.h"

namespace duet {
namespace {

using Clock = std::chrono::steady_clock;

constexpr double kAtLimit = 1e-6;  // [rad]

double milliseconds_since(Clock::time_point begin) {
  return std::chrono::duration<double, std::milli>(Clock::now() - begin).count();
}

// The descriptor of a policy; for one that has none, the observation as all of duet's own see it.
PolicyDescriptor descriptor_of(const std::string& use) {
  if (use.ends_with(".yaml")) return read_policy_descriptor(use);
  PolicyDescriptor descriptor;
  descriptor.kind = PolicyKind::kProcess;
  return descriptor;
}

std::vector<PolicyInput> inputs_of(const PolicyDescriptor& descriptor) {
  if (descriptor.kind == PolicyKind::kOnnx) return descriptor.inputs;
  PolicyInput observation;
  observation.name = "observation";
  observation.frames = kHistoryFrames;
  observation.channels = frame_channels();
  return {observation};
}

ShownChannel shown_channel(const Channel& channel, int frames, int joints, const Observation& observation,
                           ChannelValues& values) {
  ShownChannel result{channel_name(channel.kind, ChannelFormat::kPolicy),
                      channel_size(channel, {.joints = joints, .actions = 0})};
  std::vector<float> numbers(static_cast<std::size_t>(result.size));
  std::vector<float> all;
  for (int frame = kHistoryFrames - frames; frame < kHistoryFrames; ++frame) {
    values.write(channel, observation, frame, numbers);
    all.insert(all.end(), numbers.begin(), numbers.end());
  }
  const auto [low, high] = std::ranges::minmax(all);
  result.low = low;
  result.high = high;
  return result;
}

std::vector<ShownInput> shown_inputs(const PolicyDescriptor& descriptor, const std::shared_ptr<const RobotModel>& robot,
                                     const EpisodeContext& context, const Observation& observation) {
  const std::vector<int> joints = bind_joints(descriptor, *robot);
  ChannelValues values(robot, joints, descriptor);
  values.reset(context, shows_language(descriptor) ? built_in_language()->embed(context.prompt) : std::vector<float>{});
  std::vector<ShownInput> inputs;
  for (const PolicyInput& input : inputs_of(descriptor)) {
    ShownInput& to = inputs.emplace_back(ShownInput{input.name, input.frames, {}});
    for (const Channel& channel : input.channels)
      to.channels.push_back(shown_channel(channel, input.frames, static_cast<int>(joints.size()), observation, values));
  }
  return inputs;
}

std::string output_of(const std::string& use, const PolicyDescriptor& descriptor, int dof) {
  if (!use.ends_with(".yaml")) return "";
  const PlanFormat& output = descriptor.output;
  return fmt::format("{} anchors of {} numbers, {:g} s apart, frame {}", output.anchors, kPlanNumbersBeforeJoints + dof,
                     output.ticks_per_anchor * kAnchorSpacing / kTicksPerAnchor, to_string(output.frame));
}

void judge_first(const RobotModel& robot, const RobotState& now, PolicyCheck& check) {
  if (check.plan.empty()) return;
  const Reference& first = check.plan.front();
  check.root_distance = (first.X_WB.p - now.X_WB.p).norm();
  check.root_turn = first.X_WB.R.angularDistance(now.X_WB.R);
  for (int i = 0; i < robot.dof(); ++i) {
    const RobotJoint& joint = robot.joints[static_cast<std::size_t>(i)];
    const bool at_limit = first.q[i] <= joint.lower + kAtLimit || first.q[i] >= joint.upper - kAtLimit;
    check.joints_at_limits += at_limit ? 1 : 0;
  }
}

std::string range_of(const ShownInput& input) {
  const int frame = input.size() / input.frames;
  std::string text =
      fmt::format("shown: {}{} x {} numbers\n", input.name.empty() ? "" : input.name + ", ", input.frames, frame);
  for (const ShownChannel& channel : input.channels)
    text += fmt::format("  {:<22} {:>4}   {:9.3f} to {:.3f}\n", channel.name, channel.size, channel.low, channel.high);
  return text;
}

std::string anchor_line(const Reference& anchor, int tick) {
  return fmt::format(
      "  at +{:.2f} s   root ({:.3f}, {:.3f}, {:.3f}) m, heading {:.1f} deg, joints {:.3f} to {:.3f} rad\n",
      tick * kAnchorSpacing / kTicksPerAnchor, anchor.X_WB.p.x(), anchor.X_WB.p.y(), anchor.X_WB.p.z(),
      yaw_of(anchor.X_WB.R) * 180.0 / std::numbers::pi, anchor.q.minCoeff(), anchor.q.maxCoeff());
}

// Notes about what is no fault but looks like a mistake.
std::string doubts(const PolicyCheck& check) {
  // A plan begins now: the robot is not that far away from itself, and not turned away from itself.
  constexpr double kFar = 0.5, kTurned = 0.5 * std::numbers::pi;  // [m], [rad]
  std::string text;
  if (check.root_distance > kFar)
    text += fmt::format("note: the plan's first root is {:.2f} m from the robot; is the frame of 'output' right?\n",
                        check.root_distance);
  if (check.root_turn > kTurned)
    text += fmt::format(
        "note: the plan's first root is turned by {:.0f} degrees from the robot's; are its quaternions w, x, y, z, and "
        "is "
        "the frame of 'output' right?\n",
        check.root_turn * 180.0 / std::numbers::pi);
  if (check.joints_at_limits > 0)
    text += fmt::format("note: {} joints of the plan's first reference are at their limits; is their order right?\n",
                        check.joints_at_limits);
  return text;
}

}  // namespace

int ShownInput::size() const {
  int sum = 0;
  for (const ShownChannel& channel : channels) sum += channel.size;
  return sum * frames;
}

PolicyCheck check_policy(const std::string& use, const std::shared_ptr<const RobotModel>& robot,
                         const PolicyOptions& options, Task task) {
  const PolicyDescriptor descriptor = descriptor_of(use);
  PolicyCheck check;
  check.info = policy_info(use);
  check.output = output_of(use, descriptor, robot->dof());
  const PairedMotion clip = retarget(synthesize(task, SynthesisOptions()), *robot);
  check.clip = clip.clip_id;
  const RobotMotion hindsight = resample(clip.robot, 50.0);
  EpisodeContext context;
  context.task = task;
  context.prompt = task_prompt(task);
  context.start = robot->standing_state(hindsight.root.front());
  context.hindsight = &hindsight;
  ObservationHistory history;
  history.add({clip.partner.joints.frame(0), context.start});
  const Observation observation = history.at(0);
  Clock::time_point begin = Clock::now();
  const std::unique_ptr<Policy> policy = make_policy(use, robot, options);
  check.make_ms = milliseconds_since(begin);
  check.inputs = shown_inputs(descriptor, robot, context, observation);
  begin = Clock::now();
  policy->reset(context);
  check.reset_ms = milliseconds_since(begin);
  begin = Clock::now();
  check.plan = policy->plan(observation);
  check.plan_ms = milliseconds_since(begin);
  check.faults = policy->faults();
  judge_first(*robot, context.start, check);
  return check;
}

std::string describe(const PolicyCheck& check) {
  std::string text = fmt::format("policy '{}': {}\nclip: {}, its first frame\n", excerpt(check.info.name),
                                 excerpt(check.info.about), check.clip);
  for (const ShownInput& input : check.inputs) text += range_of(input);
  if (!check.output.empty()) text += fmt::format("asked for: {}\n", check.output);
  text += fmt::format("came back: {} references at 50 Hz\n", check.plan.size());
  for (std::size_t tick = 0; tick < check.plan.size(); tick += kTicksPerAnchor)
    text += anchor_line(check.plan[tick], static_cast<int>(tick));
  text += doubts(check);
  text += fmt::format("took: {:.1f} ms to make, {:.1f} ms to reset, {:.1f} ms to plan\n", check.make_ms, check.reset_ms,
                      check.plan_ms);
  return text;
}

}  // namespace duet
