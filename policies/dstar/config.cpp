#include "duet/policies/dstar/config.h"

#include <fmt/format.h>

#include <algorithm>
#include <nlohmann/json.hpp>
#include <vector>

#include "duet/core/json.h"
#include "duet/core/names.h"
#include "duet/core/require.h"
#include "duet/core/text.h"

namespace duet {
namespace {

using OrderedJson = nlohmann::ordered_json;

constexpr const char* kWhat = "configuration of D-STAR";

struct Size {
  const char* name;
  int DstarConfig::*value;
  int least, most;
};

// The bounds keep what a broken file can ask for small.
constexpr int kWidest = 8192, kDeepest = 64, kLongestStride = 500;
constexpr Size kSizes[] = {
    {"long_frames", &DstarConfig::long_frames, 1, kHistoryFrames},
    {"short_frames", &DstarConfig::short_frames, 1, kHistoryFrames},
    {"long_stride", &DstarConfig::long_stride, 1, kLongestStride},
    {"width", &DstarConfig::width, 1, kWidest},
    {"heads", &DstarConfig::heads, 1, kWidest},
    {"feedforward", &DstarConfig::feedforward, 1, kWidest},
    {"layers", &DstarConfig::layers, 1, kDeepest},
    {"stream", &DstarConfig::stream, 1, kWidest},
    {"temporal", &DstarConfig::temporal, 1, kWidest},
    {"tokens", &DstarConfig::tokens, 1, kWidest},
    {"phase_hidden", &DstarConfig::phase_hidden, 1, kWidest},
    {"phase", &DstarConfig::phase, 1, kWidest},
    {"zone", &DstarConfig::zone, 1, kWidest},
    {"orientation", &DstarConfig::orientation, 1, kWidest},
    {"field", &DstarConfig::field, 1, kWidest},
    {"field_hidden", &DstarConfig::field_hidden, 1, kWidest},
    {"fusion_heads", &DstarConfig::fusion_heads, 1, kWidest},
    {"spatial", &DstarConfig::spatial, 1, kWidest},
    {"language", &DstarConfig::language, 1, kWidest},
    {"condition", &DstarConfig::condition, 1, kWidest},
    {"channels", &DstarConfig::channels, 1, kWidest},
    {"blocks", &DstarConfig::blocks, 1, kDeepest},
    {"groups", &DstarConfig::groups, 1, kWidest},
    {"step_embedding", &DstarConfig::step_embedding, 2, kWidest},
    {"training_steps", &DstarConfig::training_steps, 1, kWidest},
    {"inference_steps", &DstarConfig::inference_steps, 1, kWidest},
};

struct Switch {
  const char* name;
  bool DstarConfig::*value;
};

constexpr Switch kSwitches[] = {
    {"phase_attention", &DstarConfig::phase_attention},
    {"spatial_reasoning", &DstarConfig::spatial_reasoning},
    {"short_stream", &DstarConfig::short_stream},
    {"language_on", &DstarConfig::language_on},
};

struct Division {
  const char* name;
  int DstarConfig::*value;
  const char* by_name;
  int DstarConfig::*by;
};

constexpr Division kDivisions[] = {
    {"width", &DstarConfig::width, "heads", &DstarConfig::heads},
    {"temporal", &DstarConfig::temporal, "tokens", &DstarConfig::tokens},
    {"field", &DstarConfig::field, "fusion_heads", &DstarConfig::fusion_heads},
    {"channels", &DstarConfig::channels, "groups", &DstarConfig::groups},
};

std::vector<std::string> known_names() {
  std::vector<std::string> names;
  for (const Size& size : kSizes) names.emplace_back(size.name);
  for (const Switch& one : kSwitches) names.emplace_back(one.name);
  return names;
}

[[noreturn]] void refuse(const std::string& file, const std::string& problem) {
  throw InputError(fmt::format("{}: {}: {}", file, kWhat, problem));
}

const OrderedJson& json_field(const OrderedJson& json, const char* name, const std::string& file) {
  const auto found = json.find(name);
  if (found == json.end()) refuse(file, fmt::format("expected a field '{}', found none", name));
  return *found;
}

int parse_size(const OrderedJson& json, const Size& size, const std::string& file) {
  const OrderedJson& value = json_field(json, size.name, file);
  const bool fits = value.is_number_integer() && value >= size.least && value <= size.most;
  if (!fits)
    refuse(file, fmt::format("'{}': expected a whole number from {} to {}, found {}", size.name, size.least, size.most,
                             shown(dumped(value))));
  return value.get<int>();
}

bool parse_switch(const OrderedJson& json, const Switch& one, const std::string& file) {
  const OrderedJson& value = json_field(json, one.name, file);
  if (!value.is_boolean())
    refuse(file, fmt::format("'{}': expected true or false, found {}", one.name, shown(dumped(value))));
  return value.get<bool>();
}

}  // namespace

std::string config_problem(const DstarConfig& config) {
  for (const Size& size : kSizes)
    if (const int value = config.*size.value; value < size.least || value > size.most)
      return fmt::format("'{}': expected a whole number from {} to {}, found {}", size.name, size.least, size.most,
                         value);
  for (const Division& division : kDivisions)
    if (config.*division.value % (config.*division.by) != 0)
      return fmt::format("'{}': expected a multiple of '{}' ({}), found {}", division.name, division.by_name,
                         config.*division.by, config.*division.value);
  if (config.step_embedding % 2 != 0)
    return fmt::format("'step_embedding': expected an even number, found {}", config.step_embedding);
  if (config.inference_steps > config.training_steps)
    return fmt::format("'inference_steps': expected at most 'training_steps' ({}), found {}", config.training_steps,
                       config.inference_steps);
  return "";
}

std::string to_json_text(const DstarConfig& config) {
  OrderedJson json = OrderedJson::object();
  for (const Size& size : kSizes) json[size.name] = config.*size.value;
  for (const Switch& one : kSwitches) json[one.name] = config.*one.value;
  return dumped(json);
}

DstarConfig parse_dstar_config(const std::string& text, const std::string& file) {
  const OrderedJson json = parse_json(text, fmt::format("{}: {}", file, kWhat));
  if (!json.is_object()) refuse(file, fmt::format("expected a JSON object, found {}", json.type_name()));
  const std::vector<std::string> known = known_names();
  for (const auto& item : json.items())
    if (std::ranges::find(known, item.key()) == known.end())
      refuse(file, unknown_name_message("field", item.key(), known));
  DstarConfig config;
  for (const Size& size : kSizes) config.*size.value = parse_size(json, size, file);
  for (const Switch& one : kSwitches) config.*one.value = parse_switch(json, one, file);
  if (const std::string problem = config_problem(config); !problem.empty()) refuse(file, problem);
  return config;
}

}  // namespace duet
