#include "duet/experiment/suite/suite_reference.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <array>

#include "duet/core/names.h"
#include "duet/core/plain_name.h"
#include "duet/robots/yaml_range.h"
#include "duet/robots/yaml_tags.h"

namespace duet {
namespace {

constexpr const char* kCommand = "command";

// "stand", "forward_0.3", "left_0.15", "turn_right_0.3"; of a mixed command its three numbers.
std::string default_name(const Eigen::Vector3d& velocity) {
  constexpr const char* kNames[3][2] = {{"forward", "back"}, {"left", "right"}, {"turn_left", "turn_right"}};
  const auto moving = (velocity.array() != 0.0).count();
  if (moving == 0) return "stand";
  if (moving > 1) return fmt::format("{}_{}_{}", velocity.x(), velocity.y(), velocity.z());
  const int axis = velocity.x() != 0.0 ? 0 : velocity.y() != 0.0 ? 1 : 2;
  return fmt::format("{}_{}", kNames[axis][velocity[axis] < 0.0], std::abs(velocity[axis]));
}

constexpr std::array<const char*, 3> kUpperBodies = {"still", "held", "moving"};  // in the order of UpperBody

UpperBody read_upper_body(const YamlSection& item) {
  if (!item.has("upper_body")) return UpperBody::kStill;
  const std::string text = item.text("upper_body");
  const auto found = std::ranges::find(kUpperBodies, text);
  if (found == kUpperBodies.end())
    item.fail(item.line("upper_body"),
              fmt::format("upper_body: expected 'still', 'held' or 'moving', found '{}'", text));
  return static_cast<UpperBody>(found - kUpperBodies.begin());
}

SuiteReference read_reference(const YAML::Node& node, const std::string& file) {
  const YamlSection item(file, node, "reference",
                         {"name", "velocity", "seconds", "begin", "end", "pause", "upper_body", kTagsKey});
  SuiteReference reference;
  reference.velocity = item.vector3("velocity");
  if (reference.velocity.cwiseAbs().maxCoeff() > 10.0)
    item.fail(item.line("velocity"), "velocity: expected at most 10 m/s and 10 rad/s");
  reference.seconds = in_range(item, "seconds", reference.seconds, {0.2, 600.0, true});
  reference.begin = in_range(item, "begin", 0.0, {0.0, reference.seconds, true});
  reference.end = in_range(item, "end", reference.seconds, {reference.begin, reference.seconds, true});
  reference.pause = in_range(item, "pause", 0.0, {0.0, 600.0, true});
  reference.upper_body = read_upper_body(item);
  reference.tags = read_tags(item, kOfClip);
  reference.name = item.has("name") ? item.text("name") : default_name(reference.velocity);
  if (!is_plain_name(reference.name))
    item.fail(item.line("name"), fmt::format("name: {}", plain_name_message(reference.name)));
  return reference;
}

}  // namespace

std::vector<SuiteReference> read_references(const YamlSection& suite, const std::string& file) {
  if (!suite.has("reference")) return {};
  const YAML::Node node = suite.node("reference");
  if (node.IsMap()) return {read_reference(node, file)};
  std::vector<SuiteReference> list;
  for (const YAML::Node& item : suite.items("reference")) {
    list.push_back(read_reference(item, file));
    const auto same = [&](const SuiteReference& other) { return other.name == list.back().name; };
    if (std::count_if(list.begin(), list.end(), same) > 1)
      suite.fail(std::max(item.Mark().line, 0) + 1,
                 fmt::format("reference: '{}' is there twice; names tell rows apart", list.back().name));
  }
  if (list.empty()) suite.fail(suite.line("reference"), "reference: expected at least one, found none");
  return list;
}

std::string references_yaml(const std::vector<SuiteReference>& references) {
  std::string text;
  for (const SuiteReference& reference : references) {
    const Eigen::Vector3d& v = reference.velocity;
    text += fmt::format(
        "\n  - {{name: {}, velocity: [{}, {}, {}], seconds: {}, begin: {}, end: {}, pause: {}, upper_body: {}{}}}",
        reference.name, v.x(), v.y(), v.z(), reference.seconds, reference.begin, reference.end, reference.pause,
        kUpperBodies.at(static_cast<std::size_t>(reference.upper_body)), tags_yaml(reference.tags));
  }
  return text;
}

const SuiteReference& reference_of(const std::vector<SuiteReference>& references, const std::string& name) {
  std::vector<std::string> known;
  for (const SuiteReference& reference : references) {
    if (reference.name == name) return reference;
    known.push_back(reference.name);
  }
  throw std::invalid_argument(unknown_name_message("reference", name, known));
}

StreamOptions stream_options(const SuiteReference& reference) {
  StreamOptions options;
  options.moves_upper_body = reference.upper_body == UpperBody::kMoving;
  options.holds_upper_body = reference.upper_body == UpperBody::kHeld;
  options.from_neutral = true;
  options.script = ScriptedCommand{
      .velocity = reference.velocity, .begin = reference.begin, .end = reference.end, .pause = reference.pause};
  return options;
}

bool takes_command(const ControllerInfo& controller) {
  return std::ranges::any_of(controller.options,
                             [](const ControllerOption& option) { return option.name == kCommand; });
}

ControllerOptions with_command(const ControllerInfo& controller, ControllerOptions options,
                               const SuiteReference& reference) {
  const Eigen::Vector3d& v = reference.velocity;
  if (takes_command(controller)) options.try_emplace(kCommand, fmt::format("{},{},{}", v.x(), v.y(), v.z()));
  return options;
}

}  // namespace duet
