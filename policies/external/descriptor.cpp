#include "duet/policies/external/descriptor.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <filesystem>

#include "duet/core/file.h"
#include "duet/core/names.h"
#include "duet/core/robot_state.h"
#include "duet/policies/policy.h"
#include "duet/robots/yaml_schema.h"

namespace duet {

std::string PolicyDescriptor::folder() const {
  const std::string parent = std::filesystem::path(file).parent_path().string();
  return parent.empty() ? "." : parent;
}

std::string_view to_string(PolicyFrame frame) { return frame == PolicyFrame::kWorld ? "world" : "ego"; }

std::string_view to_string(PlanFrame frame) {
  switch (frame) {
    case PlanFrame::kWorld:
      return "world";
    case PlanFrame::kEgo:
      return "ego";
    case PlanFrame::kDisplacement:
      return "displacement";
  }
  return "";
}

PolicyDescriptor read_policy_descriptor(const std::string& path) {
  return parse_policy_descriptor(read_text(path), path);
}

// The reader of policy descriptors. Every error names file, line, expected and found.

namespace {

constexpr const char* kSchema = "duet.policy/1";
constexpr int kMostAnchors = 1000, kMostTicks = 500;
constexpr int kMostNoise = 1000000;

void read_schema(const YamlSection& root, PolicyDescriptor&) { root.require_schema(kSchema); }

void read_joints(const YamlSection& root, PolicyDescriptor& out) {
  read_optional(root, {"joints"}, out.joints);
  out.joints_line = root.line("joints");
  for (auto it = out.joints.begin(); it != out.joints.end(); ++it)
    if (std::find(out.joints.begin(), it, *it) != it)
      root.fail(out.joints_line, fmt::format("key 'joints': expected each joint once, found '{}' again", *it));
}

void read_tasks(const YamlSection& root, PolicyDescriptor& out) {
  if (!root.has("tasks")) return;
  out.tasks.clear();
  const auto fail = [&](const std::string& message) { root.fail_key("tasks", message); };
  std::vector<std::string> names;
  read_value(root, {"tasks"}, names);
  for (const std::string& name : names) {
    try {
      out.tasks.push_back(parse_task(name));
    } catch (const std::invalid_argument& error) {
      fail(error.what());
    }
    if (std::find(out.tasks.begin(), out.tasks.end() - 1, out.tasks.back()) != out.tasks.end() - 1)
      fail(fmt::format("expected each task once, found '{}' again", name));
  }
  if (out.tasks.empty()) fail("expected at least one task, found none");
}

void read_spacing(const YamlSection& s, PlanFormat& output) {
  double spacing = kAnchorSpacing;
  read_optional(s, {"spacing"}, spacing);
  const double ticks = std::round(spacing / kTick);
  if (std::abs(ticks * kTick - spacing) > 1e-9 || ticks < 1 || ticks > kMostTicks)
    s.fail_key("spacing", fmt::format("expected a multiple of {} s in [{}, {}], found {}", kTick, kTick,
                                      kMostTicks * kTick, spacing));
  output.ticks_per_anchor = static_cast<int>(ticks);
}

// A number or a list of them.
void read_numbers(const YamlSection& s, const char* key, std::vector<double>& values) {
  if (!s.has(key)) return;
  if (s.node(key).IsScalar())
    values = {s.number(key)};
  else
    read_value(s, {key}, values);
}

const Schema<PlanFormat>& output_schema() {
  using F = PlanFormat;
  static const Schema<F> schema = {
      optional_key({"name"}, &F::name),
      optional_key({.name = "anchors", .range = {1.0, kMostAnchors}}, &F::anchors),
      {"spacing", read_spacing},
      optional_key({.name = "frame", .choices = {"world", "ego", "displacement"}}, &F::frame),
      optional_key({.name = "joints_from", .choices = {"zero", "neutral"}}, &F::joints_from_neutral),
      {"scale", [](const YamlSection& s, F& output) { read_numbers(s, "scale", output.scale); }},
      {"offset", [](const YamlSection& s, F& output) { read_numbers(s, "offset", output.offset); }}};
  return schema;
}

// The keys of every descriptor; those of one kind alone are required or refused once the kind is known.
const Schema<PolicyDescriptor>& descriptor_schema() {
  using D = PolicyDescriptor;
  const FieldRange wait = {1.0, kMostMilliseconds};
  static const Schema<D> schema = {{"schema", read_schema},
                                   required_key({"name"}, &D::name),
                                   required_key({"about"}, &D::about),
                                   required_key({.name = "kind", .choices = {"onnx", "process"}}, &D::kind),
                                   {"joints", read_joints},
                                   {"tasks", read_tasks},
                                   optional_key({.name = "frame_of_reference", .choices = {"world", "ego"}}, &D::frame),
                                   mapping_key("output", &D::output, output_schema()),
                                   {"network"},
                                   {"inputs"},
                                   optional_key({"command"}, &D::command),
                                   optional_key({"socket"}, &D::socket),
                                   optional_key({.name = "deadline_ms", .range = wait}, &D::deadline_ms),
                                   optional_key({.name = "hang_ms", .range = wait}, &D::hang_ms),
                                   optional_key({.name = "start_ms", .range = wait}, &D::start_ms)};
  return schema;
}

// Reads one descriptor; its members are the state that the steps share.
class DescriptorReader {
 public:
  DescriptorReader(const std::string& text, const std::string& file)
      : root_(read_mapping(file, parse_yaml(text, file), "policy descriptor", descriptor_schema(), out_)) {
    out_.file = file;
    out_.output.line = root_.line("output");
  }

  PolicyDescriptor read() {
    if (out_.kind == PolicyKind::kOnnx)
      read_network();
    else
      read_process();
    return std::move(out_);
  }

 private:
  void refuse_keys(std::initializer_list<const char*> keys, const char* kind) const {
    for (const char* key : keys)
      if (root_.has(key))
        root_.fail(root_.line(key), fmt::format("expected no key '{}' where 'kind' is '{}', found one", key, kind));
  }

  void read_network() {
    refuse_keys({"command", "socket", "deadline_ms", "hang_ms", "start_ms"}, "onnx");
    out_.network = root_.text("network");
    if (out_.joints.empty())
      root_.fail(out_.joints_line, "key 'joints': expected the joints in the network's order, found none");
    for (const YAML::Node& node : root_.items("inputs")) out_.inputs.push_back(read_input(node));
    if (out_.inputs.empty()) root_.fail_key("inputs", "expected at least one, found none");
  }

  [[nodiscard]] PolicyInput read_input(const YAML::Node& node) const {
    using I = PolicyInput;
    const Schema<I> schema = {
        optional_key({"name"}, &I::name),
        optional_key({.name = "frames", .range = {1.0, kHistoryFrames}}, &I::frames),
        optional_key({.name = "order", .choices = {"oldest_first", "newest_first"}}, &I::newest_first),
        {"channels", [this](const YamlSection& s, I& input) {
           for (const YAML::Node& channel : s.items("channels")) input.channels.push_back(read_channel(s, channel));
         }}};
    PolicyInput input;
    const YamlSection s = read_mapping(out_.file, node, "input", schema, input);
    if (input.channels.empty()) s.fail_key("channels", "expected at least one, found none");
    for (const Channel& channel : input.channels)
      if (input.frames > 1 && !is_of_a_frame(channel.kind))
        s.fail(channel.line, fmt::format("channel '{}': expected in an input of 1 frame, found in one of {}",
                                         name_of(channel), input.frames));
    return input;
  }

  // A name, or a mapping with the key `channel` and what is said of it.
  [[nodiscard]] Channel read_channel(const YamlSection& input, const YAML::Node& node) const {
    Channel channel{.line = std::max(node.Mark().line, 0) + 1};
    if (node.IsScalar()) {
      read_kind(input, channel.line, node.Scalar(), channel);
      refuse_noise_without_size(input, channel);
      return channel;
    }
    using C = Channel;
    const Schema<C> schema = {
        {"channel", [this](const YamlSection& s, C& c) { read_kind(s, s.line("channel"), s.text("channel"), c); }},
        {"size", read_size},
        {"offset", [this](const YamlSection& s, C& c) { read_each(s, "offset", c, c.shift); }},
        {"scale", [this](const YamlSection& s, C& c) { read_each(s, "scale", c, c.scale); }}};
    read_mapping(out_.file, node, "channel", schema, channel);
    return channel;
  }

  static std::string name_of(const Channel& channel) { return channel_name(channel.kind, ChannelFormat::kPolicy); }

  void read_kind(const YamlSection& s, int line, const std::string& name, Channel& channel) const {
    try {
      channel.kind = channel_kind(name, ChannelFormat::kPolicy);
    } catch (const std::invalid_argument& error) {
      s.fail(line, error.what());
    }
    if (channel.kind == ChannelKind::kTask) channel.size = static_cast<int>(out_.tasks.size());
  }

  static void read_size(const YamlSection& s, Channel& channel) {
    if (s.has("size") && channel.kind != ChannelKind::kNoise)
      s.fail(s.line("size"), fmt::format("expected no key 'size' in a {}, found one", name_of(channel)));
    read_optional(s, {.name = "size", .range = {1.0, kMostNoise}}, channel.size);
    refuse_noise_without_size(s, channel);
  }

  static void refuse_noise_without_size(const YamlSection& s, const Channel& channel) {
    if (channel.kind == ChannelKind::kNoise && channel.size == 0)
      s.fail(channel.line, "channel 'noise': expected {channel: noise, size: NUMBER}, found no size");
  }

  // One number for all of the channel's, or one each.
  void read_each(const YamlSection& s, const char* key, const Channel& channel, std::vector<double>& values) const {
    read_numbers(s, key, values);
    const int size = channel_size(channel, {.joints = static_cast<int>(out_.joints.size()), .actions = 0});
    if (values.size() != 1 && static_cast<int>(values.size()) != size)
      s.fail_key(key, fmt::format("expected 1 or {} numbers, found {}", size, values.size()));
  }

  void read_process() {
    refuse_keys({"network", "inputs"}, "process");
    if (!out_.output.name.empty())
      root_.fail(out_.output.line, "output: expected no key 'name' where 'kind' is 'process', found one");
    if (out_.command.empty() == out_.socket.empty())
      root_.fail(root_.line("command"), fmt::format("expected one of 'command' and 'socket', found {}",
                                                    out_.socket.empty() ? "none" : "both"));
  }

  PolicyDescriptor out_;
  YamlSection root_;
};

}  // namespace

PolicyDescriptor parse_policy_descriptor(const std::string& text, const std::string& file) {
  return DescriptorReader(text, file).read();
}

}  // namespace duet
