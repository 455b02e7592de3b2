#include "duet/controllers/descriptor.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <filesystem>

#include "duet/core/file.h"
#include "duet/core/names.h"
#include "duet/core/robot_state.h"
#include "duet/robots/yaml_schema.h"

namespace duet {

int Descriptor::actions() const {
  int count = 0;
  for (const DescriptorJoint& joint : joints) count += joint.action ? 1 : 0;
  return count;
}

std::vector<ActionRange> Descriptor::action_ranges() const {
  std::vector<ActionRange> ranges;
  for (const DescriptorJoint& joint : joints)
    if (joint.action) ranges.push_back(joint.clip.value_or(ActionRange{-action_clip, action_clip}));
  return ranges;
}

int Descriptor::ticks_per_act() const { return std::max(1, static_cast<int>(std::lround(kTickRate / rate_hz))); }
int Descriptor::acts_per_tick() const { return std::max(1, static_cast<int>(std::lround(rate_hz / kTickRate))); }

std::vector<LayoutBlock> Descriptor::layout(const ObservationInput& input) const {
  return observation.blocks(input, widths(), ChannelFormat::kController);
}

int Descriptor::input_size(const ObservationInput& input) const { return observation.input_size(input, widths()); }

std::string Descriptor::input_layout(const ObservationInput& input) const { return layout_text(layout(input)); }

Descriptor read_descriptor(const std::string& path) { return parse_descriptor(read_text(path), path); }

// The reader of IO descriptors. Every error names file, line, expected and found.

namespace {

constexpr int kMostFrames = 1000;  // of a history; more is a slip of the pen
constexpr int kMostActs = 10;      // in a tick, and ticks for one of them

int line_of(const YAML::Node& node) { return std::max(node.Mark().line, 0) + 1; }

std::string label(const char* what, const YAML::Node& node, const char* key) {
  const bool named = node.IsMap() && node[key] && node[key].IsScalar();
  return named ? fmt::format("{} '{}'", what, node[key].Scalar()) : std::string(what);
}

std::vector<std::string> names_in(const YamlSection& section, const char* key) {
  std::vector<std::string> values;
  for (const YAML::Node& item : section.items(key)) {
    if (!item.IsScalar()) section.refuse_key(key, "names", item);
    values.push_back(item.Scalar());
  }
  return values;
}

// The place of a name in a list; "'groups': unknown group ...".
int place_of(const YamlSection& section, const char* key, const char* what, const std::string& name,
             const std::vector<std::string>& known) {
  const auto it = std::ranges::find(known, name);
  if (it == known.end()) section.fail(section.line(key), unknown_name_message(what, name, known));
  return static_cast<int>(it - known.begin());
}

// A card's name, or its path from the descriptor's folder.
std::string robot_of(const std::string& given, const std::string& file) {
  if (!given.ends_with(".yaml")) return given;
  return (std::filesystem::path(file).parent_path() / given).lexically_normal().string();
}

// "clip: 18" is a bound of the size, "clip: [-1, 0.5]" a range.
void read_clip(const YamlSection& s, DescriptorJoint& joint) {
  if (!s.has("clip")) return;
  std::vector<double> bounds;
  read_value(s, {"clip"}, bounds);
  if (bounds.size() == 1 && bounds[0] > 0.0) bounds = {-bounds[0], bounds[0]};
  if (bounds.size() != 2 || bounds[0] >= bounds[1])
    s.refuse_key("clip", "a number above 0 or [lower, upper]", s.node("clip"));
  joint.clip = {bounds[0], bounds[1]};
}

FieldDoc around_words() { return {.name = "around", .choices = {"default", "reference"}}; }

const Schema<DescriptorJoint>& joint_schema() {
  using J = DescriptorJoint;
  static const Schema<J> schema = {required_key({"name"}, &J::name),
                                   required_key({"default"}, &J::neutral),
                                   required_key({.name = "kp", .range = kNotNegative}, &J::kp),
                                   required_key({.name = "kd", .range = kNotNegative}, &J::kd),
                                   optional_key({.name = "effort", .range = kPositive}, &J::effort),
                                   optional_key({"action"}, &J::action),
                                   {"clip", read_clip},
                                   optional_key(around_words(), &J::around_reference)};
  return schema;
}

const Schema<OtherJoint>& other_joint_schema() {
  using J = OtherJoint;
  static const Schema<J> schema = {required_key({"name"}, &J::name),
                                   required_key({.name = "kp", .range = kNotNegative}, &J::kp),
                                   required_key({.name = "kd", .range = kNotNegative}, &J::kd)};
  return schema;
}

void read_limits(const YamlSection& s, CommandRange& range) {
  std::vector<double> limits;
  read_value(s, {"limits"}, limits);
  if (limits.size() != 2 || limits[0] > limits[1]) s.refuse_key("limits", "[lower, upper]", s.node("limits"));
  range.lower = limits[0];
  range.upper = limits[1];
}

SchemaKey<VelocityInterface> speed_key(const char* name, CommandRange VelocityInterface::*member) {
  const Schema<CommandRange> schema = {
      {"limits", read_limits}, optional_key({.name = "steps_from", .range = kNotNegative}, &CommandRange::steps_from)};
  return {name, [name, member, schema](const SchemaSection& command, VelocityInterface& out) {
            read_mapping(command.file, command.node(name), name, schema, out.*member);
          }};
}

const Schema<VelocityInterface>& command_schema() {
  using V = VelocityInterface;
  using B = StandBounds;
  static const Schema<B> bounds = {required_key({.name = "speed", .range = kPositive}, &B::speed),
                                   required_key({.name = "yaw_rate", .range = kPositive}, &B::yaw_rate)};
  static const Schema<V> height = {{"limits", [](const YamlSection& s, V& out) { read_limits(s, out.height); }},
                                   optional_key({"offset"}, &V::height_offset)};
  static const Schema<V> schema = {speed_key("forward", &V::forward),
                                   speed_key("lateral", &V::lateral),
                                   speed_key("yaw", &V::yaw),
                                   {"height",
                                    [](const SchemaSection& s, V& out) {
                                      if (s.has("height"))
                                        read_mapping(s.file, s.node("height"), "height", height, out);
                                    }},
                                   mapping_key("stands_below", &V::stands_below, bounds)};
  return schema;
}

const Schema<OwnPhysics>& own_physics_schema() {
  using P = OwnPhysics;
  static const Schema<P> schema = {optional_key({.name = "dt", .range = kPositive}, &P::dt),
                                   optional_key({.name = "height", .range = kPositive}, &P::height)};
  return schema;
}

// "standing: zero" or a phase for each of `phases`.
void read_standing(const YamlSection& s, GaitClock& gait) {
  if (!s.has("standing")) return;
  gait.silent = s.node("standing").IsScalar() && s.node("standing").Scalar() == "zero";
  if (gait.silent)
    gait.standing.assign(gait.phases.size(), 0.0);
  else
    read_value(s, {"standing"}, gait.standing);
}

void read_gait(const SchemaSection& s, Channel& channel) {
  if (!takes_key(channel.kind, "frequency_hz")) return;
  GaitClock& gait = channel.gait;
  gait.phases = {0.0};
  static const Schema<GaitClock> schema = {
      required_key({.name = "frequency_hz", .range = kPositive}, &GaitClock::frequency_hz),
      optional_key({"phases"}, &GaitClock::phases),
      {"standing", read_standing},
      optional_key({.name = "after_standing", .choices = {"restarts", "runs_on", "pauses"}},
                   &GaitClock::after_standing),
      optional_key({"stance"}, &GaitClock::stance)};
  for (const SchemaKey<GaitClock>& key : schema) key.read(s, gait);
  if (!gait.standing.empty() && gait.standing.size() != gait.phases.size())
    s.fail_key("standing", fmt::format("expected one number for each of the {} phases, found {}", gait.phases.size(),
                                       gait.standing.size()));
  if (s.has("after_standing") && gait.standing.empty())
    s.fail_key("after_standing", "expected the key 'standing' beside it, found none");
  if (gait.stance && (*gait.stance <= 0.0 || *gait.stance >= 1.0))
    s.fail_key("stance", fmt::format("expected a number in (0, 1), found {}", *gait.stance));
}

// The kind; keys of other kinds are refused.
void read_kind(const YamlSection& s, Channel& channel) {
  try {
    channel.kind = channel_kind(s.text("channel"), ChannelFormat::kController);
  } catch (const std::invalid_argument& error) {
    s.fail(s.line("channel"), error.what());
  }
  for (const auto& entry : s.keys()) {
    const std::string& key = entry.first.Scalar();
    if (key != "channel" && key != "scale" && key != "clip" && !takes_key(channel.kind, key))
      s.fail(s.line(key.c_str()), fmt::format("expected no key '{}' in a {}, found one", key,
                                              channel_name(channel.kind, ChannelFormat::kController)));
  }
}

void read_axes(const YamlSection& s, Channel& channel) {
  channel.axes = whole_numbers(s, {.name = "axes", .range = {0.0, 2.0}});
}

// A sensor that names no frame is the base's.
void read_frame(const YamlSection& s, Channel& channel) {
  const bool is_sensor = takes_key(channel.kind, "axes");
  if (takes_key(channel.kind, "frame") && (s.has("frame") || !is_sensor)) channel.frame = s.text("frame");
}

void read_values(const YamlSection& s, Channel& channel) {
  if (takes_key(channel.kind, "values")) read_value(s, {"values"}, channel.values);
}

void read_steps(const YamlSection& s, Channel& channel) {
  if (!takes_key(channel.kind, "steps")) return;
  static_cast<void>(s.node("steps"));  // it has to be there
  channel.steps = whole_numbers(s, {.name = "steps", .range = {1.0, kMostFrames}});
}

void read_rate(const YamlSection& root, Descriptor& out) {
  out.rate_hz = root.number("rate_hz");
  const double ticks = kTickRate / out.rate_hz, acts = out.rate_hz / kTickRate, most = kMostActs;
  const auto is_whole = [&](double n) { return n >= 1.0 && n <= most && std::abs(n - std::round(n)) < 1e-9; };
  if (!is_whole(ticks) && !is_whole(acts))
    root.fail_key("rate_hz", fmt::format("expected {} divided or multiplied by a whole number up to {}, found {}",
                                         kTickRate, kMostActs, out.rate_hz));
}

// Reads one descriptor; its members are the state that the steps share.
class Reader {
 public:
  Reader(const std::string& text, const std::string& file) : file_(file), document_(parse_yaml(text, file)) {
    out_.file = file;
  }

  Descriptor read() {
    const YamlSection root = read_mapping(file_, document_, "IO descriptor", schema(), out_);
    check_stand_channels(root);
    return std::move(out_);
  }

 private:
  using Top = const YamlSection&;

  // In the order in which a message lists the keys; joints that do not say go by the action, so it is read with them.
  Schema<Descriptor> schema() {
    using D = Descriptor;
    return {required_key({"name"}, &D::name),
            required_key({"about"}, &D::about),
            required_key({"licence"}, &D::licence),
            {"robot", [this](Top root, D& out) { out.robot = robot_of(root.text("robot"), file_); }},
            required_key({"network"}, &D::network),
            {"networks", [this](Top root, D&) { read_networks(root); }},
            {"rate_hz", read_rate},
            optional_key({"walks"}, &D::walks),
            optional_key({.name = "waist", .choices = {"free", "locked"}}, &D::waist_locked),
            {"joints",
             [this](Top root, D&) {
               read_action(root);
               read_joints(root);
             }},
            {"other_joints", [this](Top root, D&) { read_other_joints(root); }},
            {"observation", [this](Top root, D&) { read_groups(root); }},
            {"inputs", [this](Top root, D&) { read_inputs(root); }},
            {"action"},
            mapping_key("command", &D::command, command_schema()),
            mapping_key("own_physics", &D::own_physics, own_physics_schema())};
  }

  void read_networks(Top root) {
    using N = OtherNetwork;
    static const Schema<N> schema = {required_key({"name"}, &N::name), required_key({"file"}, &N::file)};
    if (!root.has("networks")) return;
    for (const YAML::Node& node : root.items("networks")) {
      N network;
      const YamlSection s = read_mapping(file_, node, label("network", node, "name"), schema, network);
      if (std::ranges::find(out_.networks, network.name, &N::name) != out_.networks.end())
        s.fail(s.line("name"), fmt::format("expected each network once, found '{}' again", network.name));
      out_.networks.push_back(std::move(network));
    }
  }

  void read_joints(Top root) {
    for (const YAML::Node& node : root.items("joints")) {
      DescriptorJoint joint;
      joint.around_reference = around_reference_;
      const YamlSection s = read_mapping(file_, node, label("joint", node, "name"), joint_schema(), joint);
      for (const char* key : {"around", "clip"})
        if (s.has(key) && !joint.action) s.fail_key(key, "expected the key 'action' beside it, found none");
      refuse_repeat(s, joint.name);
      out_.joints.push_back(joint);
      joint_names_.push_back(joint.name);
    }
    if (out_.joints.empty()) root.fail_key("joints", "expected at least one, found none");
    if (out_.actions() == 0) root.fail_key("joints", "expected one that has the key 'action', found none");
  }

  void read_other_joints(Top root) {
    for (const YAML::Node& node : root.items("other_joints")) {
      OtherJoint joint;
      const YamlSection s = read_mapping(file_, node, label("other joint", node, "name"), other_joint_schema(), joint);
      refuse_repeat(s, joint.name);
      out_.other_joints.push_back(joint);
    }
  }

  void refuse_repeat(const YamlSection& s, const std::string& name) const {
    const auto named = [&](const auto& joint) { return joint.name == name; };
    if (std::ranges::any_of(out_.joints, named) || std::ranges::any_of(out_.other_joints, named))
      s.fail(s.line("name"), fmt::format("expected each joint once, found '{}' again", name));
  }

  void read_action(Top root) {
    if (!root.has("action")) return;
    using D = Descriptor;
    const Schema<D> schema = {
        optional_key({"output"}, &D::output),
        optional_key({.name = "clip", .range = kPositive}, &D::action_clip),
        optional_key({"within_limits"}, &D::within_limits),
        {"around", [this](const YamlSection& s, D&) { read_optional(s, around_words(), around_reference_); }}};
    out_.output_line = read_mapping(file_, root.node("action"), "action", schema, out_).line("output");
  }

  void read_groups(Top root) {
    const YAML::Node node = root.node("observation");
    if (!node.IsMap() || node.size() == 0) root.refuse_key("observation", "groups of channels by name", node);
    for (const auto& entry : node) {
      ChannelGroup group{.name = entry.first.Scalar(), .line = line_of(entry.first), .channels = {}};
      if (!entry.second.IsSequence() || entry.second.size() == 0)
        root.fail(group.line,
                  fmt::format("group '{}': expected a list of channels, found {}", group.name, describe(entry.second)));
      if (std::ranges::find(group_names_, group.name) != group_names_.end())
        root.fail(group.line, fmt::format("expected each group once, found '{}' again", group.name));
      for (const YAML::Node& node_of : entry.second) {
        Channel& channel = group.channels.emplace_back();
        read_scale_of(read_mapping(file_, node_of, label("channel", node_of, "channel"), channel_schema(), channel),
                      channel);
      }
      group_names_.push_back(group.name);
      out_.observation.groups.push_back(std::move(group));
    }
  }

  // Its scale is read by the caller: how many numbers it may have is known at the end.
  Schema<Channel> channel_schema() const {
    using C = Channel;
    return {{"channel", read_kind},
            {"scale"},
            optional_key({.name = "clip", .range = kPositive}, &C::clip),
            {"joints", [this](const YamlSection& s, C& channel) { read_joints_of(s, channel); }},
            {"zero"},
            {"axes", read_axes},
            optional_key({"offset"}, &C::offset),
            optional_key({"clipped"}, &C::clipped),
            {"frame", read_frame},
            {"frequency_hz", read_gait},
            {"phases"},
            {"standing"},
            {"after_standing"},
            {"stance"},
            {"steps", read_steps},
            {"values", read_values}};
  }

  void read_joints_of(const YamlSection& s, Channel& channel) const {
    if (!takes_key(channel.kind, "joints")) return;
    for (const std::string& name : names_in(s, "joints"))
      channel.joints.push_back(place_of(s, "joints", "joint", name, joint_names_));
    if (!s.has("joints"))
      for (size_t j = 0; j < out_.joints.size(); ++j) channel.joints.push_back(static_cast<int>(j));
    channel.zeroed.assign(channel.joints.size(), false);
    for (const std::string& name : names_in(s, "zero")) {
      const auto it = std::ranges::find(channel.joints, place_of(s, "zero", "joint", name, joint_names_));
      if (it == channel.joints.end())
        s.fail_key("zero", fmt::format("expected joints of the channel, found '{}'", name));
      channel.zeroed[it - channel.joints.begin()] = true;
    }
  }

  void read_scale_of(const YamlSection& s, Channel& channel) const {
    read_optional(s, {"scale"}, channel.scale);
    const int size = channel_size(channel, out_.widths());
    const int given = static_cast<int>(channel.scale.size());
    if (given != 1 && given != size)
      s.fail_key("scale", fmt::format("expected 1 or {} numbers, found {}", size, given));
  }

  // Channels that show a command to stand need to be told which command is one.
  void check_stand_channels(Top root) const {
    if (out_.command && out_.command->stands_below) return;
    for (const ChannelGroup& group : out_.observation.groups)
      for (const Channel& channel : group.channels)
        if (channel.kind == ChannelKind::kCommandStand || !channel.gait.standing.empty())
          root.fail(channel.line,
                    fmt::format("channel '{}'{}: expected the key 'stands_below' in 'command', found none",
                                channel_name(channel.kind, ChannelFormat::kController),
                                channel.gait.standing.empty() ? "" : " with 'standing'"));
  }

  void read_inputs(Top root) {
    using I = ObservationInput;
    const Schema<I> schema = {optional_key({"name"}, &I::name),
                              {"parts",
                               [this](const YamlSection& s, I& input) {
                                 for (const YAML::Node& part : s.items("parts"))
                                   read_part(part, input.parts.emplace_back());
                               }},
                              optional_key({"state"}, &I::state)};
    for (const YAML::Node& node : root.items("inputs")) {
      I input;
      const YamlSection s = read_mapping(file_, node, label("input", node, "name"), schema, input);
      if (!input.parts.empty() && !input.state.empty())
        s.fail(s.line("state"), "expected 'parts' or 'state', found both");
      if (input.parts.empty() && input.state.empty()) s.fail_key("parts", "expected at least one, found none");
      out_.observation.inputs.push_back(std::move(input));
    }
    if (out_.observation.inputs.empty()) root.fail_key("inputs", "expected at least one, found none");
  }

  static Schema<HistoryRule> history_schema() {
    using H = HistoryRule;
    return {{"groups"},
            {"from"},
            {"size"},
            optional_key({.name = "frames", .range = {1.0, kMostFrames}}, &H::frames),
            optional_key({"current"}, &H::current),
            optional_key({.name = "start", .choices = {"zeros", "repeated"}}, &H::starts_full)};
  }

  void read_part(const YAML::Node& node, InputPart& part) const {
    const YamlSection s = read_mapping(file_, node, "part", history_schema(), part.history);
    part.line = s.line();
    if (s.has("from")) return read_output(s, part);
    if (s.has("size")) s.fail_key("size", "expected the key 'from' beside it, found none");
    for (const std::string& name : names_in(s, "groups"))
      part.groups.push_back(place_of(s, "groups", "group", name, group_names_));
    if (part.groups.empty()) s.fail_key("groups", "expected at least one, found none");
  }

  // "from: encoder.latent, size: 16" in the place of groups.
  void read_output(const YamlSection& s, InputPart& part) const {
    for (const char* key : {"groups", "frames", "current", "start"})
      if (s.has(key)) s.fail_key(key, "expected 'size' alone beside 'from', found the key");
    part.from = s.text("from");
    const auto runs = [&](const OtherNetwork& network) { return part.from.starts_with(network.name + "."); };
    if (std::ranges::none_of(out_.networks, runs))
      s.fail_key("from", fmt::format("expected NETWORK.OUTPUT of one of 'networks', found '{}'", part.from));
    const double size = s.number("size");
    if (size < 1.0 || size > kMostFrames || size != std::floor(size))
      s.refuse_key("size", fmt::format("a whole number from 1 to {}", kMostFrames).c_str(), s.node("size"));
    part.size = static_cast<int>(size);
  }

  std::string file_;
  YAML::Node document_;
  Descriptor out_;
  std::vector<std::string> joint_names_, group_names_;
  bool around_reference_ = false;  // of joints that do not say
};

}  // namespace

Descriptor parse_descriptor(const std::string& text, const std::string& file) { return Reader(text, file).read(); }

}  // namespace duet
