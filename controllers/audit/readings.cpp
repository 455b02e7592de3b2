#include "duet/controllers/audit/readings.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <numbers>
#include <numeric>
#include <utility>

#include "duet/robots/roles.h"

namespace duet {
namespace {

constexpr std::array<std::string_view, 16> kPartNames = {
    "joint order",     "joint sign",      "action scale",  "observation scale", "gyro",  "gravity",
    "linear velocity", "previous action", "channel order", "history",           "clock", "command",
    "default pose",    "gains",           "rate",          "action clip"};

std::string name_of(const Channel& channel) { return channel_name(channel.kind, ChannelFormat::kController); }

bool is_of_joints(ChannelKind kind) {
  return kind == ChannelKind::kJointPosition || kind == ChannelKind::kJointVelocity ||
         kind == ChannelKind::kReferenceJointAngle || kind == ChannelKind::kReferenceJointVelocity;
}

bool is_clock(ChannelKind kind) { return kind == ChannelKind::kGaitSine || kind == ChannelKind::kGaitCosine; }

std::vector<int> identity(std::size_t size) {
  std::vector<int> order(size);
  std::iota(order.begin(), order.end(), 0);
  return order;
}

// One scale for each number that the channel shows.
std::vector<double>& spread_scale(Channel& channel, const ChannelWidths& widths) {
  if (channel.scale.size() == 1)
    channel.scale.assign(static_cast<std::size_t>(channel_size(channel, widths)), channel.scale[0]);
  return channel.scale;
}

void for_channels(Descriptor& descriptor, const std::function<void(Channel&)>& change) {
  for (ChannelGroup& group : descriptor.observation.groups)
    for (Channel& channel : group.channels) change(channel);
}

// Components of a vector under other axes: shown component i is sign[i] times component axis[i].
struct Turn {
  std::array<int, 3> axis;
  std::array<double, 3> sign;
  const char* said;
};
constexpr Turn kTurns[] = {
    {{0, 1, 2}, {-1, -1, 1}, "turned by 180 degrees about z (x and y negated)"},
    {{0, 1, 2}, {1, -1, -1}, "turned by 180 degrees about x (y and z negated)"},
    {{0, 1, 2}, {-1, 1, -1}, "turned by 180 degrees about y (x and z negated)"},
    {{0, 1, 2}, {-1, -1, -1}, "of the opposite sign"},
    {{0, 1, 2}, {-1, 1, 1}, "with x negated"},
    {{0, 1, 2}, {1, -1, 1}, "with y negated"},
    {{0, 1, 2}, {1, 1, -1}, "with z negated"},
    {{1, 0, 2}, {1, 1, 1}, "with x and y exchanged"},
    {{1, 0, 2}, {1, -1, 1}, "turned by 90 degrees about z"},
    {{1, 0, 2}, {-1, 1, 1}, "turned by -90 degrees about z"},
    {{2, 1, 0}, {1, 1, 1}, "with x and z exchanged"},
    {{0, 2, 1}, {1, 1, 1}, "with y and z exchanged"},
    {{1, 2, 0}, {1, 1, 1}, "in the order y, z, x"},
    {{2, 0, 1}, {1, 1, 1}, "in the order z, x, y"},
};

// Collects the readings of one descriptor; its members are what the steps share.
class Readings {
 public:
  Readings(const Descriptor& descriptor, const RobotModel& robot) : base_(descriptor), robot_(robot) {
    for (const DescriptorJoint& joint : base_.joints) {
      const auto found = std::ranges::find(robot.joints, joint.name, &RobotJoint::name);
      robot_joints_.push_back(found == robot.joints.end() ? -1 : static_cast<int>(found - robot.joints.begin()));
    }
  }

  std::vector<Reading> all() {
    add_orders();
    add_signs();
    add_action_scales();
    add_channel_readings();
    add_channel_orders();
    add_histories();
    add_clocks();
    add_poses();
    add_gains();
    add_rates();
    add_clips();
    return std::move(list_);
  }

 private:
  void add(ContractPart part, std::string said, int line, Descriptor descriptor, bool one_sided = false) {
    list_.push_back({part, std::move(said), line, one_sided, std::move(descriptor)});
  }

  [[nodiscard]] int line_of_joints() const { return base_.joints[0].line; }

  // Index among the descriptor's joints; -1: none.
  [[nodiscard]] int place_of(const std::string& name) const {
    const auto found = std::ranges::find(base_.joints, name, &DescriptorJoint::name);
    return found == base_.joints.end() ? -1 : static_cast<int>(found - base_.joints.begin());
  }
  [[nodiscard]] int place_of_robot_joint(int joint) const {
    const auto found = std::ranges::find(robot_joints_, joint);
    return found == robot_joints_.end() ? -1 : static_cast<int>(found - robot_joints_.begin());
  }
  [[nodiscard]] int counterpart(int place) const {
    if (robot_joints_[place] < 0 || robot_.roles.counterpart.empty()) return place;
    return std::max(place_of_robot_joint(robot_.roles.counterpart[robot_joints_[place]]), -1);
  }

  // Joint order: whole entries in another order, and numbers that stand in another order than the names.

  void add_orders() {
    for (const JointOrder& order : usual_joint_orders(robot_)) {
      const std::vector<int> from = places_in(order.joints);
      if (from == identity(from.size())) continue;
      add_order(fmt::format("the joints in {}", order.name), from);
      add_numbers(order.name, from);
    }
    add_sides();
    add_limb_orders();
    add_neighbour_orders();
  }

  void add_sides() {
    std::vector<int> from = identity(base_.joints.size());
    for (std::size_t j = 0; j < from.size(); ++j) {
      from[j] = counterpart(static_cast<int>(j));
      if (from[j] < 0 || base_.joints[from[j]].action.has_value() != base_.joints[j].action.has_value()) return;
    }
    if (from != identity(from.size())) add_order("left and right of all joints exchanged", from);
  }

  // Places among the moved joints in the order of `names`; joints that the network does not move stay.
  [[nodiscard]] std::vector<int> places_in(const std::vector<std::string>& names) const {
    std::vector<int> moved, from = identity(base_.joints.size());
    for (const std::string& name : names) {
      const int place = place_of(name);
      if (place >= 0 && base_.joints[place].action) moved.push_back(place);
    }
    std::size_t next = 0;
    for (std::size_t j = 0; j < from.size() && next < moved.size(); ++j)
      if (base_.joints[j].action) from[j] = moved[next++];
    return from;
  }

  void add_order(const std::string& said, const std::vector<int>& from, bool one_sided = false) {
    add(ContractPart::kJointOrder, said, line_of_joints(), with_joints_permuted(base_, from), one_sided);
    Descriptor names = base_;
    for (std::size_t j = 0; j < from.size(); ++j) names.joints[j].name = base_.joints[from[j]].name;
    const auto same = [](const DescriptorJoint& a, const DescriptorJoint& b) {
      return a.neutral == b.neutral && a.kp == b.kp && a.kd == b.kd && a.action == b.action;
    };
    bool differs = false;
    for (std::size_t j = 0; j < from.size(); ++j) differs |= !same(base_.joints[j], base_.joints[from[j]]);
    if (differs)
      add(ContractPart::kJointOrder, said + ", the numbers as they stand", line_of_joints(), std::move(names),
          one_sided);
  }

  // The numbers of the joints were taken from a list in that order.
  void add_numbers(const std::string& order, const std::vector<int>& from) {
    Descriptor gains = base_, poses = base_;
    std::vector<int> moved;
    for (std::size_t j = 0; j < from.size(); ++j)
      if (base_.joints[j].action) moved.push_back(static_cast<int>(j));
    for (const int j : moved) {
      gains.joints[from[j]].kp = base_.joints[j].kp;
      gains.joints[from[j]].kd = base_.joints[j].kd;
      poses.joints[from[j]].neutral = base_.joints[j].neutral;
    }
    add(ContractPart::kGains, fmt::format("gains that are listed in {}", order), line_of_joints(), std::move(gains));
    add(ContractPart::kDefaultPose, fmt::format("a default pose that is listed in {}", order), line_of_joints(),
        std::move(poses));
  }

  // Hips, shoulders, ankles in another order of their axes, on both sides.
  void add_limb_orders() {
    const auto& legs = robot_.roles.legs;
    const auto& arms = robot_.roles.arms;
    const auto add_triples = [&](const std::array<std::vector<int>, 2>& limbs, const char* what) {
      if (limbs[0].size() < 3 || limbs[1].size() < 3) return;
      std::array<int, 3> order = {0, 1, 2};
      while (std::next_permutation(order.begin(), order.end())) {
        std::vector<int> from = identity(base_.joints.size());
        bool whole = true;
        for (const std::vector<int>& limb : limbs)
          for (int k = 0; k < 3; ++k) {
            const int to = place_of_robot_joint(limb[k]), source = place_of_robot_joint(limb[order[k]]);
            whole &= to >= 0 && source >= 0;
            if (whole) from[to] = source;
          }
        if (whole)
          add_order(fmt::format("{} of both sides as {}, {}, {}", what, short_name(limbs[0][order[0]]),
                                short_name(limbs[0][order[1]]), short_name(limbs[0][order[2]])),
                    from);
      }
    };
    add_triples(legs, "the first three joints of the legs");
    add_triples(arms, "the first three joints of the arms");
  }

  [[nodiscard]] const std::string& short_name(int robot_joint) const { return robot_.joints[robot_joint].name; }

  // Neighbours in the list exchanged, on one side and on both.
  void add_neighbour_orders() {
    for (std::size_t j = 0; j + 1 < base_.joints.size(); ++j) {
      const int a = static_cast<int>(j), b = a + 1;
      if (base_.joints[a].action.has_value() != base_.joints[b].action.has_value()) continue;
      std::vector<int> from = identity(base_.joints.size());
      std::swap(from[a], from[b]);
      const int other_a = counterpart(a), other_b = counterpart(b);
      const bool pair = other_a == b;
      add_order(fmt::format("'{}' and '{}' exchanged", base_.joints[a].name, base_.joints[b].name), from, true);
      if (pair || other_a < 0 || other_b < 0 || other_a == a || other_b == b || other_a < a) continue;
      std::swap(from[other_a], from[other_b]);
      add_order(fmt::format("'{}' and '{}' exchanged, likewise on the other side", base_.joints[a].name,
                            base_.joints[b].name),
                from);
    }
    for (std::size_t j = 0; j < base_.joints.size(); ++j) {
      const int a = static_cast<int>(j), b = counterpart(a);
      if (b <= a + 1 || base_.joints[a].action.has_value() != base_.joints[b].action.has_value()) continue;
      std::vector<int> from = identity(base_.joints.size());
      std::swap(from[a], from[b]);
      add_order(fmt::format("'{}' and '{}' exchanged", base_.joints[a].name, base_.joints[b].name), from, true);
    }
  }

  // Joint signs.

  enum class Flip { kAll, kAction, kObservation };

  [[nodiscard]] Descriptor flipped(const std::vector<int>& places, Flip what) const {
    Descriptor other = base_;
    for (const int place : places) {
      DescriptorJoint& joint = other.joints[place];
      if (what == Flip::kAll) joint.neutral = -joint.neutral;
      if (what != Flip::kObservation && joint.action) joint.action = -*joint.action;
    }
    if (what == Flip::kAction) return other;
    for_channels(other, [&](Channel& channel) {
      if (!is_of_joints(channel.kind)) return;
      for (std::size_t k = 0; k < channel.joints.size(); ++k)
        if (std::ranges::find(places, channel.joints[k]) != places.end()) {
          spread_scale(channel, base_.widths())[k] *= -1.0;
        }
    });
    return other;
  }

  void add_signs() {
    for (std::size_t j = 0; j < base_.joints.size(); ++j) {
      if (!base_.joints[j].action) continue;
      const int a = static_cast<int>(j), b = counterpart(a);
      const auto add_flips = [&](const std::vector<int>& places, const std::string& who, bool one_sided) {
        const int line = base_.joints[a].line;
        add(ContractPart::kJointSign, fmt::format("{} to turn the other way", who), line, flipped(places, Flip::kAll),
            one_sided);
        add(ContractPart::kJointSign, fmt::format("the action of {} of the opposite sign", who), line,
            flipped(places, Flip::kAction), one_sided);
        add(ContractPart::kJointSign, fmt::format("angle and rate of {} of the opposite sign", who), line,
            flipped(places, Flip::kObservation), one_sided);
      };
      add_flips({a}, fmt::format("'{}'", base_.joints[a].name), b != a);
      if (b > a) add_flips({a, b}, fmt::format("'{}' and '{}'", base_.joints[a].name, base_.joints[b].name), false);
    }
  }

  void add_action_scales() {
    const auto scaled = [&](double factor) {
      Descriptor other = base_;
      for (DescriptorJoint& joint : other.joints)
        if (joint.action) joint.action = *joint.action * factor;
      return other;
    };
    for (const double factor : {0.25, 0.5, 2.0, 4.0})
      add(ContractPart::kActionScale, fmt::format("actions {:g} times as large", factor), line_of_joints(),
          scaled(factor));
    Descriptor by_effort = base_;
    for (std::size_t j = 0; j < base_.joints.size(); ++j)
      if (base_.joints[j].action && robot_joints_[j] >= 0 && base_.joints[j].kp > 0.0)
        by_effort.joints[j].action = 0.25 * robot_.joints[robot_joints_[j]].effort / base_.joints[j].kp;
    add(ContractPart::kActionScale, "actions of 0.25 effort / kp, joint by joint", line_of_joints(),
        std::move(by_effort));
  }

  // Channel by channel: scales, axes, frames.

  template <typename Change>
  Descriptor with_channel(std::size_t group, std::size_t index, const Change& change) const {
    Descriptor other = base_;
    change(other.observation.groups[group].channels[index]);
    return other;
  }

  void add_channel_readings() {
    for (std::size_t g = 0; g < base_.observation.groups.size(); ++g)
      for (std::size_t c = 0; c < base_.observation.groups[g].channels.size(); ++c) {
        const Channel& channel = base_.observation.groups[g].channels[c];
        switch (channel.kind) {
          case ChannelKind::kBaseAngularVelocity:
            add_scales(g, c, ContractPart::kObservationScale, {0.2, 0.25, 0.5, 1.0, 180.0 / std::numbers::pi});
            add_turns(g, c, ContractPart::kGyro);
            add_frames(g, c);
            break;
          case ChannelKind::kGravity:
            add_turns(g, c, ContractPart::kGravity);
            break;
          case ChannelKind::kRollPitchYaw:
          case ChannelKind::kRollPitch:
            add_turns(g, c, ContractPart::kGravity);
            break;
          case ChannelKind::kBaseLinearVelocity:
            add_scales(g, c, ContractPart::kObservationScale, {0.5, 1.0, 2.0});
            add_turns(g, c, ContractPart::kLinearVelocity);
            break;
          case ChannelKind::kJointPosition:
            add_scales(g, c, ContractPart::kObservationScale, {0.5, 1.0, 2.0});
            break;
          case ChannelKind::kJointVelocity:
            add_scales(g, c, ContractPart::kObservationScale, {0.05, 0.1, 0.2, 1.0});
            break;
          case ChannelKind::kCommandVelocity:
            add_factors(g, c, ContractPart::kCommand, {0.25, 0.5, 2.0, 4.0});
            add_turns(g, c, ContractPart::kCommand);
            break;
          case ChannelKind::kCommandHeight:
            add_scales(g, c, ContractPart::kCommand, {0.5, 1.0, 2.0});
            break;
          case ChannelKind::kPreviousAction:
            add_echoes(g, c);
            break;
          default:
            break;
        }
      }
  }

  // The channel with one scale for all of its numbers, keeping their signs.
  void add_scales(std::size_t g, std::size_t c, ContractPart part, const std::vector<double>& values) {
    const Channel& channel = base_.observation.groups[g].channels[c];
    const double own = largest(channel.scale);
    for (const double value : values)
      if (own > 0.0 && std::abs(value / own - 1.0) > 0.01)
        add(part, fmt::format("{} with a scale of {:.4g} (it says {:.4g})", name_of(channel), value, own), channel.line,
            with_channel(g, c, [&](Channel& other) {
              for (double& scale : other.scale) scale *= value / own;
            }));
  }

  static double largest(const std::vector<double>& scale) {
    double size = 0.0;
    for (const double value : scale) size = std::max(size, std::abs(value));
    return size;
  }

  void add_factors(std::size_t g, std::size_t c, ContractPart part, const std::vector<double>& factors) {
    const Channel& channel = base_.observation.groups[g].channels[c];
    const bool has_yaw = channel.axes.empty();
    for (const double factor : factors) {
      add(part, fmt::format("{} {:g} times as large", name_of(channel), factor), channel.line,
          with_channel(g, c, [&](Channel& other) {
            for (double& scale : other.scale) scale *= factor;
          }));
      if (!has_yaw) continue;
      add(part, fmt::format("a commanded yaw rate {:g} times as large", factor), channel.line,
          with_channel(g, c, [&](Channel& other) { spread_scale(other, base_.widths())[2] *= factor; }));
      add(part, fmt::format("commanded speeds {:g} times as large", factor), channel.line,
          with_channel(g, c, [&](Channel& other) {
            for (const int axis : {0, 1}) spread_scale(other, base_.widths())[axis] *= factor;
          }));
    }
  }

  void add_turns(std::size_t g, std::size_t c, ContractPart part) {
    const Channel& channel = base_.observation.groups[g].channels[c];
    const int size = channel_size(channel, base_.widths());
    const std::string name = name_of(channel);
    if (size != 3) return add_small_turns(g, c, part, size);
    const std::vector<int> own = channel.axes.empty() ? std::vector<int>{0, 1, 2} : channel.axes;
    if (takes_key(channel.kind, "axes"))
      for (const Turn& turn : kTurns)
        add(part, fmt::format("{} {}", name, turn.said), channel.line, with_channel(g, c, [&](Channel& other) {
              const std::vector<double> scale = spread_scale(other, base_.widths());
              other.axes.resize(3);
              for (int i = 0; i < 3; ++i) {
                other.axes[i] = own[turn.axis[i]];
                other.scale[i] = scale[turn.axis[i]] * turn.sign[i];
              }
            }));
    const double most = largest(channel.scale);
    const bool odd = std::ranges::any_of(channel.scale, [&](double scale) { return scale < 0.0 || scale == 0.0; });
    if (odd)
      add(part, fmt::format("{} as it is, each number with a scale of {:.4g}", name, most), channel.line,
          with_channel(g, c, [&](Channel& other) { other.scale = {most}; }));
  }

  // A vector of one or two numbers: signs, and the two exchanged.
  void add_small_turns(std::size_t g, std::size_t c, ContractPart part, int size) {
    const Channel& channel = base_.observation.groups[g].channels[c];
    for (int bits = 1; bits < (1 << size); ++bits)
      add(part,
          fmt::format("{} with the sign of {} changed", name_of(channel),
                      bits == 3   ? "both"
                      : bits == 1 ? "its first number"
                                  : "its second number"),
          channel.line, with_channel(g, c, [&](Channel& other) {
            for (int i = 0; i < size; ++i)
              if ((bits >> i & 1) != 0) spread_scale(other, base_.widths())[i] *= -1.0;
          }));
    if (size == 2 && channel.axes.size() == 2)
      add(part, fmt::format("{} with its two numbers exchanged", name_of(channel)), channel.line,
          with_channel(g, c, [&](Channel& other) { std::swap(other.axes[0], other.axes[1]); }));
  }

  void add_frames(std::size_t g, std::size_t c) {
    const Channel& channel = base_.observation.groups[g].channels[c];
    const std::string now = channel.frame;
    for (const std::string& frame : {robot_.frames[robot_.roles.imu_frame].name, robot_.links[0].name})
      if (frame != now && !(now.empty() && frame == robot_.frames[robot_.roles.imu_frame].name))
        add(ContractPart::kGyro, fmt::format("the gyro of '{}'", frame), channel.line,
            with_channel(g, c, [&](Channel& other) { other.frame = frame; }));
  }

  void add_echoes(std::size_t g, std::size_t c) {
    const Channel& channel = base_.observation.groups[g].channels[c];
    const double own = largest(channel.scale);
    double action = 0.0;
    for (const DescriptorJoint& joint : base_.joints) action = std::max(action, std::abs(joint.action.value_or(0.0)));
    const auto add_echo = [&](const std::string& said, double scale, bool clipped) {
      add(ContractPart::kPreviousAction, said, channel.line, with_channel(g, c, [&](Channel& other) {
            other.scale = {scale};
            other.clipped = clipped;
          }));
    };
    if (own != 1.0) add_echo("its previous action as it put it out", 1.0, channel.clipped);
    if (own != 0.0) add_echo("zeros for its previous action", 0.0, channel.clipped);
    if (own == 1.0 && action != 1.0) add_echo("its previous action scaled, in radians", action, channel.clipped);
    add_echo(channel.clipped ? "its previous action before the clip" : "its previous action after the clip", own,
             !channel.clipped);
    if (own != 0.0) add_echo("its previous action of the opposite sign", -channel.scale[0], channel.clipped);
  }

  // Order of channels: two exchanged, all by name; single-channel groups as the parts of an input.
  void add_channel_orders() {
    for (std::size_t g = 0; g < base_.observation.groups.size(); ++g) {
      const std::vector<Channel>& channels = base_.observation.groups[g].channels;
      for (std::size_t a = 0; a < channels.size(); ++a)
        for (std::size_t b = a + 1; b < channels.size(); ++b) {
          if (channels[a].kind == channels[b].kind) continue;
          Descriptor other = base_;
          std::swap(other.observation.groups[g].channels[a], other.observation.groups[g].channels[b]);
          add(order_part(channels[a], channels[b]),
              fmt::format("{} and {} exchanged", name_of(channels[a]), name_of(channels[b])), channels[a].line,
              std::move(other));
        }
    }
    for (std::size_t i = 0; i < base_.observation.inputs.size(); ++i) {
      const std::vector<InputPart>& parts = base_.observation.inputs[i].parts;
      if (shows_outputs(parts)) continue;
      for (std::size_t a = 0; a < parts.size(); ++a)
        for (std::size_t b = a + 1; b < parts.size(); ++b) {
          Descriptor other = base_;
          std::swap(other.observation.inputs[i].parts[a], other.observation.inputs[i].parts[b]);
          add(ContractPart::kChannelOrder,
              fmt::format("parts '{}' and '{}' exchanged", group_name(parts[a]), group_name(parts[b])), parts[a].line,
              std::move(other));
        }
    }
  }

  static ContractPart order_part(const Channel& a, const Channel& b) {
    return is_clock(a.kind) && is_clock(b.kind) ? ContractPart::kClock : ContractPart::kChannelOrder;
  }
  // Whether outputs of a network have their places among them.
  static bool shows_outputs(const std::vector<InputPart>& parts) {
    return std::ranges::any_of(parts, [](const InputPart& part) { return !part.from.empty(); });
  }
  [[nodiscard]] const std::string& group_name(const InputPart& part) const {
    return base_.observation.groups[part.groups[0]].name;
  }

  void add_histories() {
    for (std::size_t i = 0; i < base_.observation.inputs.size(); ++i) {
      const ObservationInput& input = base_.observation.inputs[i];
      const auto has_frames = [](const InputPart& part) { return part.history.frames > 1; };
      if (std::ranges::none_of(input.parts, has_frames) || shows_outputs(input.parts)) continue;
      add_majors(i);
      Descriptor full = base_, shifted = base_;
      for (InputPart& part : full.observation.inputs[i].parts) part.history.starts_full = !part.history.starts_full;
      for (InputPart& part : shifted.observation.inputs[i].parts)
        if (has_frames(part)) part.history.current = !part.history.current;
      add(ContractPart::kHistory,
          input.parts[0].history.starts_full ? "a history that begins with zeros"
                                             : "a history that begins with the first frame repeated",
          input.parts[0].line, std::move(full));
      add(ContractPart::kHistory,
          input.parts[0].history.current ? "a history without the present frame"
                                         : "a history with the present frame as its last",
          input.parts[0].line, std::move(shifted));
    }
  }

  // Frame by frame in place of term by term, and the other way round.
  void add_majors(std::size_t i) {
    const std::vector<InputPart>& parts = base_.observation.inputs[i].parts;
    Descriptor other = base_;
    std::vector<InputPart>& changed = other.observation.inputs[i].parts;
    changed.clear();
    if (parts.size() == 1) {
      for (const int g : parts[0].groups)
        for (const Channel& channel : base_.observation.groups[g].channels) {
          InputPart& part = changed.emplace_back(parts[0]);
          part.groups = {static_cast<int>(other.observation.groups.size())};
          other.observation.groups.push_back({.name = fmt::format("{} {}", name_of(channel), channel.line),
                                              .line = channel.line,
                                              .channels = {channel}});
        }
      return add(ContractPart::kHistory, "a history term by term", parts[0].line, std::move(other));
    }
    const int frames = parts[0].history.frames;
    if (!std::ranges::all_of(parts, [&](const InputPart& part) { return part.history.frames == frames; })) return;
    InputPart& whole = changed.emplace_back(parts[0]);
    whole.groups.clear();
    for (const InputPart& part : parts) whole.groups.insert(whole.groups.end(), part.groups.begin(), part.groups.end());
    add(ContractPart::kHistory, "a history frame by frame", parts[0].line, std::move(other));
  }

  void add_clocks() {
    int line = 0;
    for_channels(base_, [&](Channel& channel) {
      if (is_clock(channel.kind) && line == 0) line = channel.line;
    });
    if (line == 0) return;
    const auto add_clock = [&](const std::string& said, const std::function<void(Channel&)>& change) {
      Descriptor other = base_;
      for_channels(other, [&](Channel& channel) {
        if (is_clock(channel.kind)) change(channel);
      });
      add(ContractPart::kClock, said, line, std::move(other));
    };
    const auto shift = [](double by) {
      return [by](Channel& channel) {
        for (double& phase : channel.gait.phases) phase += by;
      };
    };
    const auto speed_up = [](double factor) {
      return [factor](Channel& channel) { channel.gait.frequency_hz *= factor; };
    };
    add_clock("a clock that is half a turn on", shift(std::numbers::pi));
    add_clock("a clock that is a quarter of a turn on", shift(0.5 * std::numbers::pi));
    add_clock("a clock that is a quarter of a turn back", shift(-0.5 * std::numbers::pi));
    add_clock("a clock at half the frequency", speed_up(0.5));
    add_clock("a clock at twice the frequency", speed_up(2.0));
    add_clock("a clock that counts radians for turns", speed_up(2.0 * std::numbers::pi));
    add_clock("a clock that counts turns for radians", speed_up(0.5 / std::numbers::pi));
    add_clock("a clock with its two feet in step", [](Channel& channel) {
      if (channel.gait.phases.size() == 2) channel.gait.phases[1] = channel.gait.phases[0];
    });
    add_clock("a clock with its two feet half a turn apart", [](Channel& channel) {
      if (channel.gait.phases.size() == 2) channel.gait.phases[1] = channel.gait.phases[0] + std::numbers::pi;
    });
  }

  void add_poses() {
    const auto add_pose = [&](const std::string& said, const std::function<double(int)>& neutral_of,
                              bool one_sided = false) {
      Descriptor other = base_;
      bool changed = false;
      for (std::size_t j = 0; j < base_.joints.size(); ++j) {
        if (!base_.joints[j].action || robot_joints_[j] < 0) continue;
        other.joints[j].neutral = neutral_of(static_cast<int>(j));
        changed |= other.joints[j].neutral != base_.joints[j].neutral;
      }
      if (changed) add(ContractPart::kDefaultPose, said, line_of_joints(), std::move(other), one_sided);
    };
    add_pose("a default pose of zeros", [](int) { return 0.0; });
    add_pose("the card's neutral pose as its default pose", [&](int j) { return robot_.neutral[robot_joints_[j]]; });
    add_pose("a default pose of the opposite sign", [&](int j) { return -base_.joints[j].neutral; });
    for (const int side : {0, 1})
      add_pose(
          side == 0 ? "the default pose of the right side as the left's mirror image"
                    : "the default pose of the left side as the right's mirror image",
          [&, side](int j) { return image(j, side); }, true);
    const auto add_share = [&](double factor) {
      add_pose(fmt::format("a default pose {:g} times as far from zero", factor),
               [&, factor](int j) { return factor * base_.joints[j].neutral; });
    };
    add_share(0.5);
    add_share(2.0);
    add_share(std::numbers::pi / 180.0);
  }

  // The default angle of a joint, or its image where it is on the other side than `source`.
  [[nodiscard]] double image(int place, int source) const {
    const std::vector<int>& leg = robot_.roles.legs[source];
    const std::vector<int>& arm = robot_.roles.arms[source];
    const int other = counterpart(place);
    const auto is_source = [&](int p) {
      return std::ranges::find(leg, robot_joints_[p]) != leg.end() ||
             std::ranges::find(arm, robot_joints_[p]) != arm.end();
    };
    if (other < 0 || other == place || !is_source(other)) return base_.joints[place].neutral;
    return mirror_sign(robot_, robot_joints_[other]) * base_.joints[other].neutral;
  }

  void add_gains() {
    const auto add_gain = [&](const std::string& said, const std::function<void(DescriptorJoint&, int)>& change) {
      Descriptor other = base_;
      for (std::size_t j = 0; j < base_.joints.size(); ++j)
        if (base_.joints[j].action && robot_joints_[j] >= 0) change(other.joints[j], robot_joints_[j]);
      add(ContractPart::kGains, said, line_of_joints(), std::move(other));
    };
    for (const double factor : {0.25, 0.5, 2.0, 4.0})
      add_gain(fmt::format("kp {:g} times as large", factor), [&](DescriptorJoint& joint, int) { joint.kp *= factor; });
    for (const double factor : {0.1, 0.25, 4.0, 10.0})
      add_gain(fmt::format("kd {:g} times as large", factor), [&](DescriptorJoint& joint, int) { joint.kd *= factor; });
    for (const double factor : {0.25, 4.0})
      add_gain(fmt::format("kp and kd {:g} times as large", factor), [&](DescriptorJoint& joint, int) {
        joint.kp *= factor;
        joint.kd *= factor;
      });
    add_gain("kp and kd exchanged", [](DescriptorJoint& joint, int) { std::swap(joint.kp, joint.kd); });
    add_gain("the gains of the robot's card", [&](DescriptorJoint& joint, int r) {
      joint.kp = robot_.joints[r].kp;
      joint.kd = robot_.joints[r].kd;
    });
  }

  void add_rates() {
    for (const double rate : {25.0, 50.0, 100.0})
      if (rate != base_.rate_hz) {
        Descriptor other = base_;
        other.rate_hz = rate;
        add(ContractPart::kRate, fmt::format("to act at {:g} Hz (it says {:g})", rate, base_.rate_hz), 0,
            std::move(other));
      }
  }

  void add_clips() {
    bool echoes_raw = false;
    for_channels(base_, [&](Channel& channel) {
      echoes_raw |= channel.kind == ChannelKind::kPreviousAction && !channel.clipped;
    });
    for (const double clip : {1.0, 10.0, 100.0}) {
      if (std::abs(clip / base_.action_clip - 1.0) <= 0.5) continue;
      Descriptor other = base_;
      other.action_clip = clip;
      for (DescriptorJoint& joint : other.joints) joint.clip.reset();
      const std::string said = fmt::format("actions clipped at {:g}", clip);
      add(ContractPart::kActionClip, said, 0, other);
      if (!echoes_raw) continue;
      for_channels(other, [](Channel& channel) { channel.clipped |= channel.kind == ChannelKind::kPreviousAction; });
      add(ContractPart::kActionClip, said + ", its previous action after the clip", 0, std::move(other));
    }
    Descriptor limited = base_;
    limited.within_limits = !base_.within_limits;
    add(ContractPart::kActionClip,
        base_.within_limits ? "targets beyond the joints' range" : "targets within the joints' range", 0,
        std::move(limited));
  }

  Descriptor base_;
  const RobotModel& robot_;
  std::vector<int> robot_joints_;  // of the descriptor's joints, in the robot; -1: none
  std::vector<Reading> list_;
};

}  // namespace

std::string_view to_string(ContractPart part) { return kPartNames[static_cast<std::size_t>(part)]; }

std::vector<Reading> other_readings(const Descriptor& descriptor, const RobotModel& robot) {
  return Readings(descriptor, robot).all();
}

std::vector<JointOrder> usual_joint_orders(const RobotModel& robot) {
  const std::vector<std::string> names = robot.joint_names();
  std::vector<JointOrder> orders = {{"the card's order", names}};
  std::vector<int> queue = {0}, breadth;
  for (std::size_t at = 0; at < queue.size(); ++at)
    for (std::size_t l = 1; l < robot.links.size(); ++l)
      if (robot.links[l].parent == queue[at]) {
        queue.push_back(static_cast<int>(l));
        breadth.push_back(static_cast<int>(l) - 1);
      }
  const auto add = [&](const char* name, const std::vector<int>& order) {
    JointOrder& added = orders.emplace_back(JointOrder{name, {}});
    for (const int j : order) added.joints.push_back(names[j]);
  };
  add("IsaacLab's order (breadth first)", breadth);
  std::vector<std::string> sorted = names;
  std::ranges::sort(sorted);
  orders.push_back({"the order of their names", sorted});
  std::vector<int> sides_swapped = identity(names.size()), by_turns;
  if (!robot.roles.counterpart.empty())
    for (std::size_t j = 0; j < names.size(); ++j) {
      const int other = robot.roles.counterpart[j];
      sides_swapped[j] = other;
      if (other < static_cast<int>(j)) continue;
      by_turns.push_back(static_cast<int>(j));
      if (other != static_cast<int>(j)) by_turns.push_back(other);
    }
  add("the card's order with right before left", sides_swapped);
  if (by_turns.size() == names.size()) add("an order of left and right by turns", by_turns);
  std::vector<std::string> reversed(names.rbegin(), names.rend());
  orders.push_back({"the card's order from the end", reversed});
  return orders;
}

Descriptor with_joints_permuted(Descriptor descriptor, const std::vector<int>& from) {
  const std::vector<DescriptorJoint> joints = descriptor.joints;
  for (std::size_t j = 0; j < from.size(); ++j) descriptor.joints[j] = joints[from[j]];
  return descriptor;
}

}  // namespace duet
