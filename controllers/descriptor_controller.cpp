#include "duet/controllers/descriptor_controller.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <span>

#include "duet/controllers/observer.h"
#include "duet/controllers/root_conversion.h"
#include "duet/core/field.h"
#include "duet/core/named_table.h"
#include "duet/core/names.h"
#include "duet/core/require.h"
#include "duet/core/robot_state.h"
#include "duet/io/bound_network.h"
#include "duet/io/channel.h"
#include "duet/robots/roles.h"

namespace duet {
namespace {

// Places of the commanded yaw rate among the channel's numbers.
std::vector<int> yaw_rates(const Channel& channel) {
  if (channel.kind != ChannelKind::kCommandVelocity) return {};
  constexpr int kYawRate = 2;
  if (channel.axes.empty()) return {kYawRate};
  std::vector<int> places;
  for (size_t i = 0; i < channel.axes.size(); ++i)
    if (channel.axes[i] == kYawRate) places.push_back(static_cast<int>(i));
  return places;
}

bool shows_yaw_rate(const Descriptor& descriptor) {
  for (const ChannelGroup& group : descriptor.observation.groups)
    for (const Channel& channel : group.channels)
      if (!yaw_rates(channel).empty()) return true;
  return false;
}

void set_yaw_scale(Channel& channel, double scale) {
  const std::vector<int> places = yaw_rates(channel);
  if (places.empty()) return;
  if (channel.scale.size() == 1) channel.scale.assign(channel_size(channel, {}), channel.scale[0]);
  for (const int place : places) channel.scale[place] = scale;
}

enum class WaistMode { kFree, kLocked };

// The options of a descriptor's controller; the network's file is found by find_network (published.h).
struct DescriptorOptions {
  std::string network, engine = "duet";
  WaistMode waist = WaistMode::kFree;
  RootConversionLaw conversion = RootConversionLaw::kAdopted;
  std::string command = {};  // of parse_velocity_command; "": of the reference's root
  std::optional<double> yaw_scale = {};
};

Field<DescriptorOptions> command_field() {
  constexpr const char* kForms = "\"vx,vy,wz\" or \"vx,vy,wz,height\"";
  return field<DescriptorOptions>(
      {.name = "command", .meaning = "[m/s, m/s, rad/s, m] instead of what is made of the reference's root"}, kForms,
      [](const DescriptorOptions& options) { return options.command; },
      [](DescriptorOptions& options, const std::string& text) -> std::string {
        try {
          if (!text.empty()) static_cast<void>(parse_velocity_command(text, 0.0));
        } catch (const std::invalid_argument&) {
          return kForms;
        }
        options.command = text;
        return "";
      });
}

FieldTable<DescriptorOptions> option_table(const Descriptor& descriptor) {
  using O = DescriptorOptions;
  FieldTable<O> table = {field<O>({.name = "network", .meaning = "path of the network's file"}, &O::network),
                         field<O>({.name = "engine", .meaning = "what evaluates the network"}, &O::engine),
                         field<O>({.name = "waist",
                                   .meaning = "locked: waist roll and pitch are held at 0 where the robot has them",
                                   .choices = {"free", "locked"}},
                                  &O::waist)};
  if (descriptor.command) {
    table.push_back(field<O>({.name = "conversion",
                              .meaning = "of the reference's root to a velocity (A.4.3)",
                              .choices = root_conversion_names()},
                             &O::conversion));
    table.push_back(command_field());
  }
  if (shows_yaw_rate(descriptor))
    table.push_back(
        field<O>({.name = "yaw_scale", .meaning = "scale of the commanded yaw rate instead of the descriptor's"},
                 &O::yaw_scale));
  return table;
}

DescriptorOptions defaults_of(const Descriptor& descriptor) {
  DescriptorOptions defaults;
  defaults.network = descriptor.network;
  defaults.waist = descriptor.waist_locked ? WaistMode::kLocked : WaistMode::kFree;
  return defaults;
}

Descriptor with_yaw_scale(Descriptor descriptor, const std::optional<double>& scale) {
  if (!scale) return descriptor;
  for (ChannelGroup& group : descriptor.observation.groups)
    for (Channel& channel : group.channels) set_yaw_scale(channel, *scale);
  return descriptor;
}

// One of the robot's joints as the descriptor has it.
struct BoundJoint {
  int robot = 0;
  int action = -1;  // index in the network's output; -1: the reference's angle
  double neutral = 0.0, scale = 0.0, kp = 0.0, kd = 0.0;
  double effort = std::numeric_limits<double>::infinity();
  double lower = -std::numeric_limits<double>::infinity(), upper = std::numeric_limits<double>::infinity();
  ActionRange clip{};
  bool around_reference = false, locked = false;
};

class DescriptorController final : public Controller {
 public:
  DescriptorController(const Descriptor& descriptor, std::shared_ptr<const RobotModel> robot,
                       std::unique_ptr<Network> network, const std::string& network_path,
                       const DescriptorOptions& options, std::shared_ptr<const VelocityCommand> told)
      : robot_(std::move(robot)),
        told_(std::move(told)),
        name_(descriptor.name),
        ticks_per_act_(descriptor.ticks_per_act()),
        acts_per_tick_(descriptor.acts_per_tick()),
        period_(descriptor.period()),
        joints_(bind_joints(descriptor, *robot_, options.waist == WaistMode::kLocked)),
        network_(std::move(network), descriptor.file, network_path),
        observer_(with_yaw_scale(descriptor, options.yaw_scale), robot_, first_joints(descriptor.joints.size())),
        rates_(robot_->dof(), kTick),
        action_(descriptor.actions()),
        gains_(robot_->default_command(robot_->neutral)) {
    for (const BoundJoint& joint : joints_) {
      gains_.kp[joint.robot] = joint.kp;
      gains_.kd[joint.robot] = joint.kd;
    }
    bind_output(descriptor);
    bind_inputs(descriptor);
    if (descriptor.command && told_ == nullptr) bind_command(*descriptor.command, options);
    if (descriptor.command) gate_ = StandGate(descriptor.command->stands_below);
  }

  [[nodiscard]] std::string_view name() const override { return name_; }
  [[nodiscard]] int acts_per_tick() const override { return acts_per_tick_; }

  void reset(const RobotState&) override {
    calls_ = 0;
    gate_.reset();
    std::ranges::fill(action_, 0.0F);
    rates_.reset();
    observer_.reset();
    network_.reset();
    if (conversion_) conversion_->reset();
  }

  void act(const RobotState& state, const Reference& reference, JointCommand& command) override {
    if (calls_ % acts_per_tick_ == 0) {
      rates_.update(reference);
      if (conversion_) command_ = conversion_->update(state, reference, rates_.v_WB(), rates_.w_WB_B().z());
      if (told_ != nullptr) command_ = *told_;
    }
    if (calls_ % ticks_per_act_ == 0) ask(state, reference);
    ++calls_;
    command.kp = gains_.kp;
    command.kd = gains_.kd;
    command.tau_ff = gains_.tau_ff;
    command.q_target.resize(state.q.size());
    for (const BoundJoint& joint : joints_) command.q_target[joint.robot] = target(joint, state, reference);
  }

 private:
  // The network acts: at its own rate. Its histories, its clocks and its last action know of no other tick.
  void ask(const RobotState& state, const Reference& reference) {
    gate_.update(command_.forward, command_.lateral, command_.yaw_rate);
    const VelocityCommand shown = gate_.stands() ? VelocityCommand{.height = command_.height} : command_;
    observer_.update({state, reference, rates_, shown, action_, calls_ / ticks_per_act_, gate_, period_});
    network_.run();
    std::ranges::copy(network_.output(action_output_), action_.begin());
  }

  [[nodiscard]] double target(const BoundJoint& joint, const RobotState& state, const Reference& reference) const {
    if (joint.locked) return 0.0;
    const double wanted = reference.q[joint.robot];
    if (joint.action < 0) return wanted;
    const float action =
        std::clamp(action_[joint.action], static_cast<float>(joint.clip.lower), static_cast<float>(joint.clip.upper));
    const double free = (joint.around_reference ? wanted : joint.neutral) + joint.scale * action;
    const double goal = std::clamp(free, joint.lower, joint.upper);
    if (joint.effort == std::numeric_limits<double>::infinity() || joint.kp == 0.0) return goal;
    const double middle = state.q[joint.robot] + joint.kd * state.v[joint.robot] / joint.kp;
    return std::clamp(goal, middle - joint.effort / joint.kp, middle + joint.effort / joint.kp);
  }

  // The descriptor's joints in its order, then those of the others that the robot has.
  static std::vector<BoundJoint> bind_joints(const Descriptor& descriptor, const RobotModel& robot, bool lock_waist) {
    const JointBinding bound = bind_by_name(names_of(descriptor.joints), robot);
    if (!bound.absent.empty())
      refuse_robot(descriptor, robot, unknown_name_message("joint", bound.absent[0], robot.joint_names()));
    const std::vector<ActionRange> clips = descriptor.action_ranges();
    std::vector<BoundJoint> joints;
    int actions = 0;
    for (size_t j = 0; j < descriptor.joints.size(); ++j) {
      const DescriptorJoint& joint = descriptor.joints[j];
      joints.push_back({.robot = bound.indices[j],
                        .action = joint.action ? actions++ : -1,
                        .neutral = joint.neutral,
                        .scale = joint.action.value_or(0.0),
                        .kp = joint.kp,
                        .kd = joint.kd,
                        .effort = joint.effort.value_or(std::numeric_limits<double>::infinity()),
                        .around_reference = joint.around_reference});
      if (!joint.action) continue;
      joints.back().clip = clips[static_cast<size_t>(actions) - 1];
      if (!descriptor.within_limits) continue;
      joints.back().lower = robot.joints[bound.indices[j]].lower;
      joints.back().upper = robot.joints[bound.indices[j]].upper;
    }
    add_other_joints(descriptor, robot, bound.unnamed, joints);
    const std::vector<int> tilting = tilting_waist(robot);
    for (BoundJoint& joint : joints)
      joint.locked = lock_waist && std::ranges::find(tilting, joint.robot) != tilting.end();
    return joints;
  }

  // Adds the joints that the network does not see; `left`: the robot's joints that are not the network's.
  static void add_other_joints(const Descriptor& descriptor, const RobotModel& robot, std::vector<std::string> left,
                               std::vector<BoundJoint>& joints) {
    const JointBinding bound = bind_by_name(names_of(descriptor.other_joints), robot);
    for (size_t j = 0; j < bound.indices.size(); ++j) {
      const OtherJoint& joint = descriptor.other_joints[j];
      if (bound.indices[j] >= 0) joints.push_back({.robot = bound.indices[j], .kp = joint.kp, .kd = joint.kd});
      std::erase(left, joint.name);
    }
    if (!left.empty())
      refuse_robot(descriptor, robot,
                   fmt::format("expected joints of its descriptor, found also {}", fmt::join(left, ", ")));
  }

  [[noreturn]] static void refuse_robot(const Descriptor& descriptor, const RobotModel& robot,
                                        const std::string& problem) {
    throw std::invalid_argument(fmt::format("{}: controller '{}' with robot '{}': {} (it was made for '{}')",
                                            descriptor.file, descriptor.name, robot.name, problem, descriptor.robot));
  }

  [[nodiscard]] std::vector<int> first_joints(size_t count) const {
    std::vector<int> indices;
    for (size_t j = 0; j < count; ++j) indices.push_back(joints_[j].robot);
    return indices;
  }

  void bind_inputs(const Descriptor& descriptor) {
    for (size_t i = 0; i < descriptor.observation.inputs.size(); ++i) {
      const ObservationInput& input = descriptor.observation.inputs[i];
      if (input.state.empty())
        network_.bind_input(input.name, input.line, observer_.input(static_cast<int>(i)), descriptor.layout(input));
      else
        network_.bind_state(input.name, input.line, input.state);
    }
    network_.require_all_bound();
  }

  void bind_output(const Descriptor& descriptor) {
    action_output_ = network_.find_output(descriptor.output, descriptor.output_line);
    const Port& port = network_.outputs()[action_output_];
    if (port.size != descriptor.actions())
      throw InputError(fmt::format("{}: output '{}': expected {} numbers, one for each joint with an action, found {}",
                                   network_.place(descriptor.output_line), port.name, descriptor.actions(), port.size));
  }

  void bind_command(const VelocityInterface& interface, const DescriptorOptions& options) {
    if (options.command.empty())
      conversion_.emplace(options.conversion, interface);
    else
      command_ = parse_velocity_command(options.command, interface.height.upper);
  }

  std::shared_ptr<const RobotModel> robot_;
  std::shared_ptr<const VelocityCommand> told_;  // null: the reference's root, or a fixed command
  std::string name_;
  int ticks_per_act_, acts_per_tick_;  // one of them is 1
  double period_;                      // of the network [s]
  std::vector<BoundJoint> joints_;
  BoundNetwork network_;
  Observer observer_;
  ReferenceRates rates_;
  std::optional<RootConversion> conversion_;  // none where the command is fixed or there is none
  VelocityCommand command_;
  StandGate gate_;
  std::vector<float> action_;  // the network's last output
  JointCommand gains_;
  int action_output_ = 0;
  long calls_ = 0;  // of act() since reset
};

}  // namespace

ControllerInfo descriptor_info(const Descriptor& descriptor) {
  std::map<std::string, double> posture;
  for (const DescriptorJoint& joint : descriptor.joints)
    if (!joint.action) posture[joint.name] = joint.neutral;
  return {.name = descriptor.name,
          .about = fmt::format("{} (licence: {})", descriptor.about, descriptor.licence),
          .robot = descriptor.robot,
          .walks = descriptor.walks,
          .options = option_list<ControllerOption>(option_table(descriptor), defaults_of(descriptor)),
          .posture = std::move(posture)};
}

std::unique_ptr<Controller> make_descriptor_controller(
    const Descriptor& descriptor, std::shared_ptr<const RobotModel> robot, std::unique_ptr<Network> network,
    const std::string& network_path, const ControllerOptions& options, std::shared_ptr<const VelocityCommand> told) {
  require(robot != nullptr && network != nullptr, "controller '{}': expected a robot and a network, found none",
          descriptor.name);
  require(told == nullptr || descriptor.command.has_value(),
          "{}: controller '{}': expected a descriptor with a 'command' to be told a velocity, found none",
          descriptor.file, descriptor.name);
  require(told == nullptr || descriptor.acts_per_tick() == 1,
          "{}: controller '{}': expected a rate_hz of at most {} to be told a velocity at each tick, found {}",
          descriptor.file, descriptor.name, kTickRate, descriptor.rate_hz);
  const DescriptorOptions read =
      read_options("controller", descriptor.name, option_table(descriptor), options, defaults_of(descriptor));
  return std::make_unique<DescriptorController>(descriptor, std::move(robot), std::move(network), network_path, read,
                                                std::move(told));
}

}  // namespace duet
