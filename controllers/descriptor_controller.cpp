#include "controllers/descriptor_controller.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <span>

#include "controllers/observer.h"
#include "controllers/root_conversion.h"
#include "core/clock.h"
#include "core/names.h"
#include "core/number.h"
#include "core/require.h"

namespace duet {
namespace {

constexpr const char* kLockedWaist[] = {"waist_roll_joint", "waist_pitch_joint"};

bool shows(const Descriptor& descriptor, ChannelKind kind) {
  for (const ChannelGroup& group : descriptor.groups)
    for (const Channel& channel : group.channels)
      if (channel.kind == kind) return true;
  return false;
}

// Scale of the commanded yaw rate: the third of the channel's.
double& yaw_scale(Channel& channel) {
  if (channel.scale.size() == 1) channel.scale.assign(3, channel.scale[0]);
  return channel.scale[2];
}

Descriptor with_yaw_scale(Descriptor descriptor, const ControllerOptions& options) {
  const std::string text = option_or(options, "yaw_scale");
  if (text.empty()) return descriptor;
  const std::optional<double> scale = parse_number(text);
  require(scale.has_value(), fmt::format("option 'yaw_scale': expected a number, found '{}'", text));
  for (ChannelGroup& group : descriptor.groups)
    for (Channel& channel : group.channels)
      if (channel.kind == ChannelKind::kCommandVelocity) yaw_scale(channel) = *scale;
  return descriptor;
}

bool waist_is_locked(const Descriptor& descriptor, const ControllerOptions& options) {
  const std::string text = option_or(options, "waist", descriptor.waist_locked ? "locked" : "free");
  const std::vector<std::string> known = {"free", "locked"};
  if (text != "free" && text != "locked")
    throw std::invalid_argument(unknown_name_message("value of the option 'waist'", text, known));
  return text == "locked";
}

std::vector<std::string> port_names(std::span<const Port> ports) {
  std::vector<std::string> names;
  for (const Port& port : ports) names.push_back(port.name);
  return names;
}

// Index of the port that the descriptor means; "" is the only one.
int find_port(std::span<const Port> ports, const std::string& name, const char* what, const std::string& place) {
  if (name.empty() && ports.size() == 1) return 0;
  for (size_t i = 0; i < ports.size(); ++i)
    if (ports[i].name == name) return static_cast<int>(i);
  throw InputError(fmt::format("{}: {}", place,
                               name.empty()
                                   ? fmt::format("expected the name of one of the network's {}s ({}), found none", what,
                                                 fmt::join(port_names(ports), ", "))
                                   : unknown_name_message(what, name, port_names(ports))));
}

// One of the robot's joints as the descriptor has it.
struct BoundJoint {
  int robot = 0;
  int action = -1;  // index in the network's output; -1: the reference's angle
  double neutral = 0.0, scale = 0.0, kp = 0.0, kd = 0.0;
  double effort = std::numeric_limits<double>::infinity();
  bool locked = false;
};

class DescriptorController final : public Controller {
 public:
  DescriptorController(const Descriptor& descriptor, std::shared_ptr<const RobotModel> robot,
                       std::unique_ptr<Network> network, const std::string& network_path,
                       const ControllerOptions& options)
      : robot_(std::move(robot)),
        name_(descriptor.name),
        clip_(static_cast<float>(descriptor.action_clip)),
        around_reference_(descriptor.around_reference),
        joints_(bind_joints(descriptor, *robot_, waist_is_locked(descriptor, options))),
        network_(std::move(network)),
        observer_(with_yaw_scale(descriptor, options), robot_, first_joints(descriptor.joints.size())),
        rates_(robot_->dof(), kTick),
        action_(descriptor.actions()),
        gains_(robot_->default_command(robot_->neutral)) {
    for (const BoundJoint& joint : joints_) {
      gains_.kp[joint.robot] = joint.kp;
      gains_.kd[joint.robot] = joint.kd;
    }
    bind_inputs(descriptor, network_path);
    bind_outputs(descriptor, network_path);
    if (descriptor.command) bind_command(*descriptor.command, options);
  }

  [[nodiscard]] std::string_view name() const override { return name_; }

  void reset(const RobotState&) override {
    tick_ = 0;
    std::ranges::fill(action_, 0.0F);
    rates_.reset();
    observer_.reset();
    network_->reset();
    if (conversion_) conversion_->reset();
  }

  void act(const RobotState& state, const Reference& reference, JointCommand& command) override {
    rates_.update(reference);
    if (conversion_) command_ = conversion_->update(state, reference, rates_.v_WB(), rates_.w_WB_B().z());
    observer_.update({state, reference, rates_, command_, action_, tick_});
    network_->run(inputs_, outputs_);
    std::ranges::copy(outputs_[action_output_], action_.begin());
    command.kp = gains_.kp;
    command.kd = gains_.kd;
    command.tau_ff = gains_.tau_ff;
    command.q_target.resize(state.q.size());
    for (const BoundJoint& joint : joints_) command.q_target[joint.robot] = target(joint, state, reference);
    ++tick_;
  }

 private:
  [[nodiscard]] double target(const BoundJoint& joint, const RobotState& state, const Reference& reference) const {
    if (joint.locked) return 0.0;
    const double wanted = reference.q[joint.robot];
    if (joint.action < 0) return wanted;
    const float action = std::clamp(action_[joint.action], -clip_, clip_);
    const double goal = (around_reference_ ? wanted : joint.neutral) + joint.scale * action;
    if (joint.effort == std::numeric_limits<double>::infinity() || joint.kp == 0.0) return goal;
    const double middle = state.q[joint.robot] + joint.kd * state.v[joint.robot] / joint.kp;
    return std::clamp(goal, middle - joint.effort / joint.kp, middle + joint.effort / joint.kp);
  }

  // The descriptor's joints in its order, then those of the others that the robot has.
  static std::vector<BoundJoint> bind_joints(const Descriptor& descriptor, const RobotModel& robot, bool lock_waist) {
    std::vector<BoundJoint> joints;
    int actions = 0;
    for (const DescriptorJoint& joint : descriptor.joints)
      joints.push_back({.robot = joint_of(descriptor, robot, joint.name),
                        .action = joint.action ? actions++ : -1,
                        .neutral = joint.neutral,
                        .scale = joint.action.value_or(0.0),
                        .kp = joint.kp,
                        .kd = joint.kd,
                        .effort = joint.effort.value_or(std::numeric_limits<double>::infinity())});
    const std::vector<std::string> names = robot.joint_names();
    for (const OtherJoint& joint : descriptor.other_joints) {
      const auto it = std::ranges::find(names, joint.name);
      if (it != names.end())
        joints.push_back({.robot = static_cast<int>(it - names.begin()), .kp = joint.kp, .kd = joint.kd});
    }
    refuse_unknown_joints(descriptor, robot, joints);
    for (BoundJoint& joint : joints)
      joint.locked = lock_waist && std::ranges::find(kLockedWaist, names[joint.robot]) != std::end(kLockedWaist);
    return joints;
  }

  static int joint_of(const Descriptor& descriptor, const RobotModel& robot, const std::string& name) {
    const std::vector<std::string> names = robot.joint_names();
    const auto it = std::ranges::find(names, name);
    require(it != names.end(),
            fmt::format("{}: controller '{}' with robot '{}': {} (it was made for '{}')", descriptor.file,
                        descriptor.name, robot.name, unknown_name_message("joint", name, names), descriptor.robot));
    return static_cast<int>(it - names.begin());
  }

  static void refuse_unknown_joints(const Descriptor& descriptor, const RobotModel& robot,
                                    const std::vector<BoundJoint>& joints) {
    std::vector<std::string> unknown;
    for (int r = 0; r < robot.dof(); ++r)
      if (std::ranges::none_of(joints, [&](const BoundJoint& joint) { return joint.robot == r; }))
        unknown.push_back(robot.joints[r].name);
    require(unknown.empty(),
            fmt::format("{}: controller '{}' with robot '{}': expected joints of its descriptor, found also "
                        "{} (it was made for '{}')",
                        descriptor.file, descriptor.name, robot.name, fmt::join(unknown, ", "), descriptor.robot));
  }

  [[nodiscard]] std::vector<int> first_joints(size_t count) const {
    std::vector<int> indices;
    for (size_t j = 0; j < count; ++j) indices.push_back(joints_[j].robot);
    return indices;
  }

  void bind_inputs(const Descriptor& descriptor, const std::string& network_path) {
    const std::span<const Port> ports = network_->inputs();
    inputs_.resize(ports.size());
    for (size_t i = 0; i < descriptor.inputs.size(); ++i) {
      const DescriptorInput& input = descriptor.inputs[i];
      const std::string place = fmt::format("{}:{}: with {}", descriptor.file, input.line, network_path);
      const int port = find_port(ports, input.name, "input", place);
      inputs_[port] = observer_.input(static_cast<int>(i));
      if (static_cast<int>(inputs_[port].size()) != ports[port].size)
        throw InputError(fmt::format("{}: input '{}': expected {} numbers, found {} of the channels: {}", place,
                                     ports[port].name, ports[port].size, inputs_[port].size(),
                                     descriptor.input_layout(input)));
    }
    for (size_t port = 0; port < ports.size(); ++port)
      if (inputs_[port].data() == nullptr)
        throw InputError(
            fmt::format("{}: with {}: expected every input of the network in 'inputs', found none for '{}'",
                        descriptor.file, network_path, ports[port].name));
  }

  void bind_outputs(const Descriptor& descriptor, const std::string& network_path) {
    const std::span<const Port> ports = network_->outputs();
    const std::string place = fmt::format("{}:{}: with {}", descriptor.file, descriptor.output_line, network_path);
    action_output_ = find_port(ports, descriptor.output, "output", place);
    for (const Port& port : ports) output_values_.emplace_back(port.size);
    for (std::vector<float>& values : output_values_) outputs_.emplace_back(values);
    if (ports[action_output_].size != descriptor.actions())
      throw InputError(fmt::format("{}: output '{}': expected {} numbers, one for each joint with an action, found {}",
                                   place, ports[action_output_].name, descriptor.actions(),
                                   ports[action_output_].size));
  }

  void bind_command(const VelocityInterface& interface, const ControllerOptions& options) {
    const std::string fixed = option_or(options, "command");
    const RootConversionLaw law = root_conversion_law(option_or(options, "conversion", "adopted"));
    if (fixed.empty())
      conversion_.emplace(law, interface);
    else
      command_ = parse_velocity_command(fixed, interface.height.upper);
  }

  std::shared_ptr<const RobotModel> robot_;
  std::string name_;
  float clip_;
  bool around_reference_;
  std::vector<BoundJoint> joints_;
  std::unique_ptr<Network> network_;
  Observer observer_;
  ReferenceRates rates_;
  std::optional<RootConversion> conversion_;  // none where the command is fixed or there is none
  VelocityCommand command_;
  std::vector<float> action_;  // the network's last output
  JointCommand gains_;
  std::vector<std::span<const float>> inputs_;  // in the network's order
  std::vector<std::vector<float>> output_values_;
  std::vector<std::span<float>> outputs_;
  int action_output_ = 0;
  long tick_ = 0;
};

}  // namespace

ControllerInfo descriptor_info(const Descriptor& descriptor) {
  ControllerInfo info{.name = descriptor.name,
                      .about = fmt::format("{} (licence: {})", descriptor.about, descriptor.licence),
                      .robot = descriptor.robot,
                      .walks = descriptor.walks,
                      .options = {}};
  info.options = {{"network", descriptor.network, "path of the network's file"},
                  {"engine", "duet", "what evaluates the network"},
                  {"waist", descriptor.waist_locked ? "locked" : "free",
                   "free; or locked: waist roll and pitch are held at 0 where the robot has them"}};
  if (descriptor.command) {
    info.options.push_back(
        {"conversion", "adopted", "of the reference's root to a velocity: printed, adopted or direct (A.4.3)"});
    info.options.push_back({"command", "", "\"vx,vy,wz\" or \"vx,vy,wz,height\" instead of the reference's root"});
  }
  if (shows(descriptor, ChannelKind::kCommandVelocity))
    info.options.push_back({"yaw_scale", "", "scale of the commanded yaw rate instead of the descriptor's"});
  return info;
}

std::unique_ptr<Controller> make_descriptor_controller(const Descriptor& descriptor,
                                                       std::shared_ptr<const RobotModel> robot,
                                                       std::unique_ptr<Network> network,
                                                       const std::string& network_path,
                                                       const ControllerOptions& options) {
  require(robot != nullptr && network != nullptr,
          fmt::format("controller '{}': expected a robot and a network, found none", descriptor.name));
  return std::make_unique<DescriptorController>(descriptor, std::move(robot), std::move(network), network_path,
                                                options);
}

}  // namespace duet
