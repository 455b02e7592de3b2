// The reader of IO descriptors. Every error names file, line, expected and found.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <filesystem>

#include "duet/controllers/descriptor.h"
#include "duet/core/clock.h"
#include "duet/core/names.h"
#include "duet/robots/yaml_section.h"

namespace duet {
namespace {

constexpr int kMostFrames = 1000;  // of a history; more is a slip of the pen
constexpr const char* kChannelKeys[] = {"joints",       "zero",   "axes",     "offset", "clipped", "frame",
                                        "frequency_hz", "phases", "standing", "stance", "steps",   "values"};

int line_of(const YAML::Node& node) { return std::max(node.Mark().line, 0) + 1; }

std::string label(const char* what, const YAML::Node& node, const char* key) {
  const bool named = node.IsMap() && node[key] && node[key].IsScalar();
  return named ? fmt::format("{} '{}'", what, node[key].Scalar()) : std::string(what);
}

double finite_number(const YamlSection& section, const char* key, const YAML::Node& node) {
  double value = 0.0;
  if (!node.IsScalar() || !YAML::convert<double>::decode(node, value) || !std::isfinite(value))
    section.fail(section.line(key), fmt::format("'{}': expected finite numbers, found {}", key, describe(node)));
  return value;
}

// A number or a list of them; `fallback` where the key is absent.
std::vector<double> numbers(const YamlSection& section, const char* key, std::vector<double> fallback = {}) {
  if (!section.has(key)) return fallback;
  const YAML::Node node = section.node(key);
  if (node.IsScalar()) return {finite_number(section, key, node)};
  std::vector<double> values;
  for (const YAML::Node& item : section.items(key)) values.push_back(finite_number(section, key, item));
  if (values.empty()) section.fail(section.line(key), fmt::format("'{}': expected numbers, found none", key));
  return values;
}

std::vector<std::string> texts(const YamlSection& section, const char* key) {
  std::vector<std::string> values;
  for (const YAML::Node& item : section.items(key)) {
    if (!item.IsScalar())
      section.fail(section.line(key), fmt::format("'{}': expected names, found {}", key, describe(item)));
    values.push_back(item.Scalar());
  }
  return values;
}

double not_negative(const YamlSection& section, const char* key, double value) {
  if (value < 0.0) section.fail(section.line(key), fmt::format("'{}': expected a number >= 0, found {}", key, value));
  return value;
}

double positive(const YamlSection& section, const char* key, double value) {
  if (value <= 0.0) section.fail(section.line(key), fmt::format("'{}': expected a number > 0, found {}", key, value));
  return value;
}

int whole_number(const YamlSection& section, const char* key, double value, int least, int most) {
  if (value != std::floor(value) || value < least || value > most)
    section.fail(section.line(key),
                 fmt::format("'{}': expected a whole number in [{}, {}], found {}", key, least, most, value));
  return static_cast<int>(value);
}

std::string one_of(const YamlSection& section, const char* key, const std::string& fallback,
                   const std::vector<std::string>& known) {
  if (!section.has(key)) return fallback;
  std::string value = section.text(key);
  if (std::find(known.begin(), known.end(), value) == known.end())
    section.fail(section.line(key), unknown_name_message(key, value, known));
  return value;
}

// A card's name, or its path from the descriptor's folder.
std::string robot_of(const std::string& given, const std::string& file) {
  if (!given.ends_with(".yaml")) return given;
  return (std::filesystem::path(file).parent_path() / given).lexically_normal().string();
}

// Reads one descriptor; its members are the state that the steps share.
class Reader {
 public:
  Reader(const std::string& text, const std::string& file)
      : file_(file),
        root_(file, parse_yaml(text, file), "IO descriptor",
              {"name", "about", "licence", "robot", "network", "rate_hz", "walks", "waist", "joints", "other_joints",
               "observation", "inputs", "action", "command"}) {}

  Descriptor read() {
    out_.file = file_;
    out_.name = root_.text("name");
    out_.about = root_.text("about");
    out_.licence = root_.text("licence");
    out_.robot = robot_of(root_.text("robot"), file_);
    out_.network = root_.text("network");
    out_.walks = root_.flag_or("walks", false);
    out_.waist_locked = one_of(root_, "waist", "free", {"free", "locked"}) == "locked";
    if (const double rate = root_.number("rate_hz"); rate != kTickRate)
      root_.fail(root_.line("rate_hz"), fmt::format("'rate_hz': expected {}, found {}", kTickRate, rate));
    read_action();
    read_joints();
    read_groups();
    read_inputs();
    if (root_.has("command")) out_.command = read_command();
    check_stand_channels();
    return std::move(out_);
  }

 private:
  void read_joints() {
    for (const YAML::Node& node : root_.items("joints")) {
      const YamlSection s(file_, node, label("joint", node, "name"),
                          {"name", "default", "kp", "kd", "effort", "action", "around"});
      DescriptorJoint joint{.name = s.text("name"),
                            .line = s.line(),
                            .neutral = s.number("default"),
                            .kp = not_negative(s, "kp", s.number("kp")),
                            .kd = not_negative(s, "kd", s.number("kd")),
                            .effort = s.optional_number("effort"),
                            .action = s.optional_number("action"),
                            .around_reference = around_reference(s, around_reference_)};
      if (joint.effort) positive(s, "effort", *joint.effort);
      if (s.has("around") && !joint.action)
        s.fail(s.line("around"), "'around': expected the key 'action' beside it, found none");
      refuse_repeat(s, joint.name);
      out_.joints.push_back(joint);
      joint_names_.push_back(joint.name);
    }
    if (out_.joints.empty()) root_.fail(root_.line("joints"), "'joints': expected at least one, found none");
    if (out_.actions() == 0)
      root_.fail(root_.line("joints"), "'joints': expected one that has the key 'action', found none");
    for (const YAML::Node& node : root_.items("other_joints")) {
      const YamlSection s(file_, node, label("other joint", node, "name"), {"name", "kp", "kd"});
      refuse_repeat(s, s.text("name"));
      out_.other_joints.push_back({.name = s.text("name"),
                                   .line = s.line(),
                                   .kp = not_negative(s, "kp", s.number("kp")),
                                   .kd = not_negative(s, "kd", s.number("kd"))});
    }
  }

  void refuse_repeat(const YamlSection& s, const std::string& name) const {
    const bool seen =
        std::any_of(out_.joints.begin(), out_.joints.end(), [&](const auto& j) { return j.name == name; }) ||
        std::any_of(out_.other_joints.begin(), out_.other_joints.end(), [&](const auto& j) { return j.name == name; });
    if (seen) s.fail(s.line("name"), fmt::format("expected each joint once, found '{}' again", name));
  }

  void read_action() {
    if (!root_.has("action")) return;
    const YamlSection s(file_, root_.node("action"), "action", {"output", "clip", "around"});
    out_.output_line = s.line("output");
    if (s.has("output")) out_.output = s.text("output");
    if (s.has("clip")) out_.action_clip = positive(s, "clip", s.number("clip"));
    around_reference_ = around_reference(s, false);
  }

  static bool around_reference(const YamlSection& s, bool otherwise) {
    return one_of(s, "around", otherwise ? "reference" : "default", {"default", "reference"}) == "reference";
  }

  void read_groups() {
    const YAML::Node node = root_.node("observation");
    if (!node.IsMap() || node.size() == 0)
      root_.fail(root_.line("observation"),
                 fmt::format("'observation': expected groups of channels by name, found {}", describe(node)));
    for (const auto& entry : node) {
      ChannelGroup group{.name = entry.first.Scalar(), .line = line_of(entry.first), .channels = {}};
      if (!entry.second.IsSequence() || entry.second.size() == 0)
        root_.fail(group.line, fmt::format("group '{}': expected a list of channels, found {}", group.name,
                                           describe(entry.second)));
      if (std::find(group_names_.begin(), group_names_.end(), group.name) != group_names_.end())
        root_.fail(group.line, fmt::format("expected each group once, found '{}' again", group.name));
      for (const YAML::Node& channel : entry.second) group.channels.push_back(read_channel(channel));
      group_names_.push_back(group.name);
      out_.observation.groups.push_back(std::move(group));
    }
  }

  Channel read_channel(const YAML::Node& node) const {
    const YamlSection s(file_, node, label("channel", node, "channel"),
                        {"channel", "scale", "clip", "joints", "zero", "axes", "offset", "clipped", "frame",
                         "frequency_hz", "phases", "standing", "stance", "steps", "values"});
    Channel channel;
    channel.line = s.line();
    channel.kind = kind_of(s);
    for (const char* key : kChannelKeys)
      if (s.has(key) && !takes_key(channel.kind, key))
        s.fail(s.line(key), fmt::format("expected no key '{}' in a {}, found one", key,
                                        channel_name(channel.kind, ChannelFormat::kController)));
    if (s.has("clip")) channel.clip = positive(s, "clip", s.number("clip"));
    if (s.has("offset")) channel.offset = s.vector3("offset");
    channel.clipped = s.flag_or("clipped", false);
    read_joints_of(s, channel);
    read_lists_of(s, channel);
    read_scale_of(s, channel);
    return channel;
  }

  static ChannelKind kind_of(const YamlSection& s) {
    try {
      return channel_kind(s.text("channel"), ChannelFormat::kController);
    } catch (const std::invalid_argument& error) {
      s.fail(s.line("channel"), error.what());
    }
  }

  void read_joints_of(const YamlSection& s, Channel& channel) const {
    if (!takes_key(channel.kind, "joints")) return;
    for (const std::string& name : texts(s, "joints")) channel.joints.push_back(joint_of(s, "joints", name));
    if (!s.has("joints"))
      for (size_t j = 0; j < out_.joints.size(); ++j) channel.joints.push_back(static_cast<int>(j));
    channel.zeroed.assign(channel.joints.size(), false);
    for (const std::string& name : texts(s, "zero")) {
      const int joint = joint_of(s, "zero", name);
      const auto it = std::find(channel.joints.begin(), channel.joints.end(), joint);
      if (it == channel.joints.end())
        s.fail(s.line("zero"), fmt::format("'zero': expected joints of the channel, found '{}'", name));
      channel.zeroed[it - channel.joints.begin()] = true;
    }
  }

  int joint_of(const YamlSection& s, const char* key, const std::string& name) const {
    const auto it = std::find(joint_names_.begin(), joint_names_.end(), name);
    if (it == joint_names_.end()) s.fail(s.line(key), unknown_name_message("joint", name, joint_names_));
    return static_cast<int>(it - joint_names_.begin());
  }

  static void read_lists_of(const YamlSection& s, Channel& channel) {
    for (const double axis : numbers(s, "axes")) channel.axes.push_back(whole_number(s, "axes", axis, 0, 2));
    const bool is_sensor = takes_key(channel.kind, "axes");  // of the base, where no frame is named
    if (takes_key(channel.kind, "frame") && (s.has("frame") || !is_sensor)) channel.frame = s.text("frame");
    if (takes_key(channel.kind, "frequency_hz")) channel.gait = read_gait(s);
    if (takes_key(channel.kind, "values")) channel.values = numbers(s, "values", {});
    if (takes_key(channel.kind, "steps"))
      for (const double step : numbers(s, "steps"))
        channel.steps.push_back(whole_number(s, "steps", step, 1, kMostFrames));
    if (takes_key(channel.kind, "values") && channel.values.empty()) (void)s.node("values");
    if (takes_key(channel.kind, "steps") && channel.steps.empty()) (void)s.node("steps");
  }

  static GaitClock read_gait(const YamlSection& s) {
    GaitClock gait{.frequency_hz = positive(s, "frequency_hz", s.number("frequency_hz")),
                   .phases = numbers(s, "phases", {0.0}),
                   .standing = numbers(s, "standing"),
                   .stance = s.optional_number("stance")};
    if (!gait.standing.empty() && gait.standing.size() != gait.phases.size())
      s.fail(s.line("standing"), fmt::format("'standing': expected one number for each of the {} phases, found {}",
                                             gait.phases.size(), gait.standing.size()));
    if (gait.stance && (*gait.stance <= 0.0 || *gait.stance >= 1.0))
      s.fail(s.line("stance"), fmt::format("'stance': expected a number in (0, 1), found {}", *gait.stance));
    return gait;
  }

  // Channels that show a command to stand need to be told which command is one.
  void check_stand_channels() const {
    if (out_.command && out_.command->stands_below) return;
    for (const ChannelGroup& group : out_.observation.groups)
      for (const Channel& channel : group.channels)
        if (channel.kind == ChannelKind::kCommandStand || !channel.gait.standing.empty())
          root_.fail(channel.line,
                     fmt::format("channel '{}'{}: expected the key 'stands_below' in 'command', found none",
                                 channel_name(channel.kind, ChannelFormat::kController),
                                 channel.gait.standing.empty() ? "" : " with 'standing'"));
  }

  void read_scale_of(const YamlSection& s, Channel& channel) const {
    channel.scale = numbers(s, "scale", {1.0});
    const int size = channel_size(channel, out_.widths());
    const int given = static_cast<int>(channel.scale.size());
    if (given != 1 && given != size)
      s.fail(s.line("scale"), fmt::format("'scale': expected 1 or {} numbers, found {}", size, given));
  }

  void read_inputs() {
    for (const YAML::Node& node : root_.items("inputs")) {
      const YamlSection s(file_, node, label("input", node, "name"), {"name", "parts", "state"});
      ObservationInput input{.name = s.has("name") ? s.text("name") : "", .line = s.line(), .parts = {}, .state = {}};
      for (const YAML::Node& part : s.items("parts")) input.parts.push_back(read_part(part));
      if (s.has("state")) input.state = s.text("state");
      if (!input.parts.empty() && !input.state.empty())
        s.fail(s.line("state"), "expected 'parts' or 'state', found both");
      if (input.parts.empty() && input.state.empty())
        s.fail(s.line("parts"), "'parts': expected at least one, found none");
      out_.observation.inputs.push_back(std::move(input));
    }
    if (out_.observation.inputs.empty())
      root_.fail(root_.line("inputs"), "'inputs': expected at least one, found none");
  }

  InputPart read_part(const YAML::Node& node) const {
    const YamlSection s(file_, node, "part", {"groups", "frames", "current", "start"});
    InputPart part{.line = s.line(), .groups = {}};
    for (const std::string& name : texts(s, "groups")) {
      const auto it = std::find(group_names_.begin(), group_names_.end(), name);
      if (it == group_names_.end()) s.fail(s.line("groups"), unknown_name_message("group", name, group_names_));
      part.groups.push_back(static_cast<int>(it - group_names_.begin()));
    }
    if (part.groups.empty()) s.fail(s.line("groups"), "'groups': expected at least one, found none");
    part.history.frames = whole_number(s, "frames", s.optional_number("frames").value_or(1.0), 1, kMostFrames);
    part.history.current = s.flag_or("current", true);
    part.history.starts_full = one_of(s, "start", "zeros", {"zeros", "repeated"}) == "repeated";
    return part;
  }

  VelocityInterface read_command() const {
    const YamlSection s(file_, root_.node("command"), "command",
                        {"forward", "lateral", "yaw", "height", "stands_below"});
    VelocityInterface command;
    command.forward = read_speed(s, "forward");
    command.lateral = read_speed(s, "lateral");
    command.yaw = read_speed(s, "yaw");
    if (s.has("stands_below")) command.stands_below = read_stand_bounds(s.node("stands_below"));
    if (!s.has("height")) return command;
    const YamlSection height(file_, s.node("height"), "height", {"limits", "offset"});
    command.height = read_limits(height);
    command.height_offset = height.optional_number("offset").value_or(0.0);
    return command;
  }

  [[nodiscard]] StandBounds read_stand_bounds(const YAML::Node& node) const {
    const YamlSection s(file_, node, "stands_below", {"speed", "yaw_rate"});
    return {.speed = positive(s, "speed", s.number("speed")),
            .yaw_rate = positive(s, "yaw_rate", s.number("yaw_rate"))};
  }

  CommandRange read_speed(const YamlSection& command, const char* key) const {
    const YamlSection s(file_, command.node(key), key, {"limits", "steps_from"});
    CommandRange range = read_limits(s);
    range.steps_from = not_negative(s, "steps_from", s.optional_number("steps_from").value_or(0.0));
    return range;
  }

  static CommandRange read_limits(const YamlSection& s) {
    const std::vector<double> limits = numbers(s, "limits");
    if (limits.size() != 2 || limits[0] > limits[1])
      s.fail(s.line("limits"), fmt::format("'limits': expected [lower, upper], found {}", describe(s.node("limits"))));
    return {.lower = limits[0], .upper = limits[1]};
  }

  std::string file_;
  YamlSection root_;
  Descriptor out_;
  std::vector<std::string> joint_names_, group_names_;
  bool around_reference_ = false;  // of joints that do not say
};

}  // namespace

Descriptor parse_descriptor(const std::string& text, const std::string& file) { return Reader(text, file).read(); }

}  // namespace duet
