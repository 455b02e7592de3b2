// The reader of policy descriptors. Every error names file, line, expected and found.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "duet/core/clock.h"
#include "duet/core/names.h"
#include "duet/policies/external/descriptor.h"
#include "duet/policies/policy.h"
#include "duet/robots/yaml_section.h"

namespace duet {
namespace {

constexpr const char* kSchema = "duet.policy/1";
constexpr int kMostAnchors = 1000, kMostTicks = 500;
constexpr int kMostNoise = 1000000;

std::string text_or(const YamlSection& section, const char* key, const std::string& fallback) {
  return section.has(key) ? section.text(key) : fallback;
}

// The place of the key's word in `known`; of `fallback` where the key is absent.
int choice(const YamlSection& section, const char* key, const std::string& fallback,
           const std::vector<std::string>& known) {
  const std::string word = text_or(section, key, fallback);
  const auto it = std::ranges::find(known, word);
  if (it == known.end()) section.fail(section.line(key), unknown_name_message(key, word, known));
  return static_cast<int>(it - known.begin());
}

int whole_or(const YamlSection& section, const char* key, int fallback, int least, int most) {
  const double value = section.optional_number(key).value_or(fallback);
  if (value != std::floor(value) || value < least || value > most)
    section.fail(section.line(key),
                 fmt::format("'{}': expected a whole number in [{}, {}], found {}", key, least, most, value));
  return static_cast<int>(value);
}

std::vector<std::string> texts(const YamlSection& section, const char* key) {
  std::vector<std::string> values;
  for (const YAML::Node& item : section.items(key)) {
    if (!item.IsScalar() || item.Scalar().empty())
      section.fail(section.line(key), fmt::format("'{}': expected texts, found {}", key, describe(item)));
    values.push_back(item.Scalar());
  }
  return values;
}

// A number or a list of them, without a NaN.
std::vector<double> numbers_or(const YamlSection& section, const char* key, double fallback) {
  if (!section.has(key)) return {fallback};
  if (section.node(key).IsScalar()) return {section.number(key)};
  std::vector<double> values;
  for (const YAML::Node& item : section.items(key)) {
    double value = 0.0;
    if (!item.IsScalar() || !YAML::convert<double>::decode(item, value) || !std::isfinite(value))
      section.fail(section.line(key), fmt::format("'{}': expected finite numbers, found {}", key, describe(item)));
    values.push_back(value);
  }
  if (values.empty()) section.fail(section.line(key), fmt::format("'{}': expected numbers, found none", key));
  return values;
}

// Reads one descriptor; its members are the state that the steps share.
class DescriptorReader {
 public:
  DescriptorReader(const std::string& text, const std::string& file)
      : root_(file, parse_yaml(text, file), "policy descriptor",
              {"schema", "name", "about", "kind", "joints", "tasks", "frame_of_reference", "output", "network",
               "inputs", "command", "socket", "deadline_ms", "hang_ms", "start_ms"}) {
    out_.file = file;
  }

  PolicyDescriptor read() {
    if (root_.text("schema") != kSchema)
      root_.fail(root_.line("schema"),
                 fmt::format("'schema': expected '{}', found '{}'", kSchema, root_.text("schema")));
    out_.name = root_.text("name");
    out_.about = root_.text("about");
    out_.kind = static_cast<PolicyKind>(choice(root_, "kind", root_.text("kind"), {"onnx", "process"}));
    out_.frame = static_cast<PolicyFrame>(choice(root_, "frame_of_reference", "world", {"world", "ego"}));
    read_joints();
    read_tasks();
    read_output();
    if (out_.kind == PolicyKind::kOnnx)
      read_network();
    else
      read_process();
    return std::move(out_);
  }

 private:
  void read_joints() {
    out_.joints = texts(root_, "joints");
    out_.joints_line = root_.line("joints");
    for (auto it = out_.joints.begin(); it != out_.joints.end(); ++it)
      if (std::find(out_.joints.begin(), it, *it) != it)
        root_.fail(out_.joints_line, fmt::format("'joints': expected each joint once, found '{}' again", *it));
  }

  void read_tasks() {
    if (!root_.has("tasks")) return;
    out_.tasks.clear();
    const auto fail = [&](const std::string& message) { root_.fail(root_.line("tasks"), "'tasks': " + message); };
    for (const std::string& name : texts(root_, "tasks")) {
      try {
        out_.tasks.push_back(parse_task(name));
      } catch (const std::invalid_argument& error) {
        fail(error.what());
      }
      if (std::find(out_.tasks.begin(), out_.tasks.end() - 1, out_.tasks.back()) != out_.tasks.end() - 1)
        fail(fmt::format("expected each task once, found '{}' again", name));
    }
    if (out_.tasks.empty()) fail("expected at least one task, found none");
  }

  void read_output() {
    PlanFormat& output = out_.output;
    output.line = root_.line("output");
    if (!root_.has("output")) return;
    const YamlSection s(out_.file, root_.node("output"), "output",
                        {"name", "anchors", "spacing", "frame", "joints_from", "scale", "offset"});
    output.name = text_or(s, "name", "");
    output.anchors = whole_or(s, "anchors", output.anchors, 1, kMostAnchors);
    output.ticks_per_anchor = read_spacing(s);
    output.frame = static_cast<PlanFrame>(choice(s, "frame", "world", {"world", "ego", "displacement"}));
    output.joints_from_neutral = choice(s, "joints_from", "zero", {"zero", "neutral"}) == 1;
    output.scale = numbers_or(s, "scale", 1.0);
    output.offset = numbers_or(s, "offset", 0.0);
  }

  static int read_spacing(const YamlSection& s) {
    const double spacing = s.optional_number("spacing").value_or(kAnchorSpacing);
    const double ticks = std::round(spacing / kTick);
    if (std::abs(ticks * kTick - spacing) > 1e-9 || ticks < 1 || ticks > kMostTicks)
      s.fail(s.line("spacing"), fmt::format("'spacing': expected a multiple of {} s in [{}, {}], found {}", kTick,
                                            kTick, kMostTicks * kTick, spacing));
    return static_cast<int>(ticks);
  }

  void refuse_keys(std::initializer_list<const char*> keys, const char* kind) const {
    for (const char* key : keys)
      if (root_.has(key))
        root_.fail(root_.line(key), fmt::format("expected no key '{}' where 'kind' is '{}', found one", key, kind));
  }

  void read_network() {
    refuse_keys({"command", "socket", "deadline_ms", "hang_ms", "start_ms"}, "onnx");
    out_.network = root_.text("network");
    if (out_.joints.empty())
      root_.fail(out_.joints_line, "'joints': expected the joints in the network's order, found none");
    for (const YAML::Node& node : root_.items("inputs")) out_.inputs.push_back(read_input(node));
    if (out_.inputs.empty()) root_.fail(root_.line("inputs"), "'inputs': expected at least one, found none");
  }

  [[nodiscard]] PolicyInput read_input(const YAML::Node& node) const {
    const YamlSection s(out_.file, node, "input", {"name", "frames", "order", "channels"});
    PolicyInput input{.name = text_or(s, "name", ""), .line = s.line(), .channels = {}};
    input.frames = whole_or(s, "frames", 1, 1, kHistoryFrames);
    input.newest_first = choice(s, "order", "oldest_first", {"oldest_first", "newest_first"}) == 1;
    for (const YAML::Node& channel : s.items("channels")) input.channels.push_back(read_channel(s, channel));
    if (input.channels.empty()) s.fail(s.line("channels"), "'channels': expected at least one, found none");
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
      channel.kind = kind_of(input, channel.line, node.Scalar());
      if (channel.kind == ChannelKind::kTask) channel.size = static_cast<int>(out_.tasks.size());
      refuse_noise_without_size(input, channel);
      return channel;
    }
    const YamlSection s(out_.file, node, "channel", {"channel", "size", "offset", "scale"});
    channel.kind = kind_of(s, s.line("channel"), s.text("channel"));
    if (s.has("size") && channel.kind != ChannelKind::kNoise)
      s.fail(s.line("size"), fmt::format("expected no key 'size' in a {}, found one", name_of(channel)));
    if (channel.kind == ChannelKind::kTask) channel.size = static_cast<int>(out_.tasks.size());
    if (s.has("size")) channel.size = whole_or(s, "size", 0, 1, kMostNoise);
    refuse_noise_without_size(s, channel);
    channel.shift = numbers_for(s, "offset", 0.0, channel);
    channel.scale = numbers_for(s, "scale", 1.0, channel);
    return channel;
  }

  static std::string name_of(const Channel& channel) { return channel_name(channel.kind, ChannelFormat::kPolicy); }

  static ChannelKind kind_of(const YamlSection& s, int line, const std::string& name) {
    try {
      return channel_kind(name, ChannelFormat::kPolicy);
    } catch (const std::invalid_argument& error) {
      s.fail(line, error.what());
    }
  }

  static void refuse_noise_without_size(const YamlSection& s, const Channel& channel) {
    if (channel.kind == ChannelKind::kNoise && channel.size == 0)
      s.fail(channel.line, "channel 'noise': expected {channel: noise, size: NUMBER}, found no size");
  }

  [[nodiscard]] std::vector<double> numbers_for(const YamlSection& s, const char* key, double fallback,
                                                const Channel& channel) const {
    std::vector<double> values = numbers_or(s, key, fallback);
    const int size = channel_size(channel, {.joints = static_cast<int>(out_.joints.size()), .actions = 0});
    if (values.size() != 1 && static_cast<int>(values.size()) != size)
      s.fail(s.line(key), fmt::format("'{}': expected 1 or {} numbers, found {}", key, size, values.size()));
    return values;
  }

  void read_process() {
    refuse_keys({"network", "inputs"}, "process");
    if (!out_.output.name.empty())
      root_.fail(out_.output.line, "output: expected no key 'name' where 'kind' is 'process', found one");
    out_.command = texts(root_, "command");
    out_.socket = text_or(root_, "socket", "");
    if (out_.command.empty() == out_.socket.empty())
      root_.fail(root_.line("command"), fmt::format("expected one of 'command' and 'socket', found {}",
                                                    out_.socket.empty() ? "none" : "both"));
    if (root_.has("deadline_ms")) out_.deadline_ms = whole_or(root_, "deadline_ms", 1, 1, kMostMilliseconds);
    out_.hang_ms = whole_or(root_, "hang_ms", out_.hang_ms, 1, kMostMilliseconds);
    out_.start_ms = whole_or(root_, "start_ms", out_.start_ms, 1, kMostMilliseconds);
  }

  YamlSection root_;
  PolicyDescriptor out_;
};

}  // namespace

PolicyDescriptor parse_policy_descriptor(const std::string& text, const std::string& file) {
  return DescriptorReader(text, file).read();
}

}  // namespace duet
