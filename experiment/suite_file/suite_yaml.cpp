// Reads and writes suite files: strict YAML -> Suite, by the table of its keys.
#include <fmt/format.h>

#include <algorithm>

#include "duet/backends/engine_module.h"
#include "duet/core/file.h"
#include "duet/core/named_table.h"
#include "duet/core/names.h"
#include "duet/core/require.h"
#include "duet/experiment/plan/episode.h"
#include "duet/experiment/suite/suite.h"
#include "duet/experiment/suite_file/suite_actors.h"
#include "duet/experiment/suite_file/suite_key.h"
#include "duet/robots/yaml_section.h"
#include "duet/rollout/yielding_partner.h"

namespace duet {
namespace {

bool is_led_by_clips(const SuiteKey& key) { return key.with == SuiteKey::With::kClips; }

// A root that moves by command leaves nothing for these keys to say.
void refuse_clips(const YamlSection& top) {
  for (const SuiteKey& key : suite_keys())
    if (is_led_by_clips(key) && top.has(key.name.c_str()))
      top.fail(
          top.line(key.name.c_str()),
          fmt::format("{}: expected no such key beside `reference`, which has neither clips nor policies nor people",
                      key.name));
}

// A command that comes and goes is nothing for a controller that takes one for the whole episode.
void check_commands(const YamlSection& top, const Suite& suite) {
  for (const SuiteController& controller : suite.controllers) {
    if (!takes_command(about(controller))) continue;
    for (const SuiteReference& reference : suite.references)
      if (!reference.constant())
        top.fail(top.line("reference"),
                 fmt::format("reference '{}': controller '{}' takes one velocity for the whole episode: expected no "
                             "begin, end and pause",
                             reference.name, controller.name));
  }
}

// A reference is run under perturbations that are there.
void check_references(const YamlSection& top, const Suite& suite) {
  for (const SuiteReference& reference : suite.references)
    checked(top, "reference", [&] {
      for (const std::string& name : reference.perturbations)
        require(std::ranges::find(suite.perturbations, name, &Perturbation::name) != suite.perturbations.end(),
                "'{}': {}", reference.name, unknown_name_message("perturbation", name, suite.perturbation_names()));
    });
}

void check_partner(const YamlSection& top, const Suite& suite) {
  if (suite.partner != SuitePartner::kYielding) return;
  for (const std::string& engine : suite.engines)
    if (const double dt = suite.profile.settings(engine).dt; dt > kYieldingLongestStep)
      top.fail_key("partner", fmt::format("a yielding partner needs a physics step of at most {} s, found {} s of '{}'",
                                          kYieldingLongestStep, dt, engine));
}

// Checks the keys against each other.
void check_whole(const YamlSection& top, const Suite& suite) {
  if (!suite.references.empty()) check_commands(top, suite);
  check_references(top, suite);
  check_variants(top, suite);
  check_partner(top, suite);
  const SuiteClips& clips = suite.clips;
  const std::size_t made = clips.synth_per_task * suite.tasks.size() + clips.files.size() * (1 + clips.synth_per_file);
  require_sane_size(suite, static_cast<std::int64_t>(made * clips.copies() + suite.references.size()));
}

void require_known_engines(const YamlSection& top, const Suite& suite) {
  std::vector<std::string> known = {std::string(kPlaybackEngine)};
  for (const EngineInfo& engine : engines()) known.push_back(engine.name);
  checked(top, "engines", [&] {
    for (const std::string& name : suite.engines) require_known("engine", name, known);
  });
}

// A run may be of engines whose modules are elsewhere.
enum class Origin { kUser, kRun };

Suite read_suite(const YAML::Node& document, const std::string& file, Origin origin) {
  std::vector<const char*> names;
  for (const SuiteKey& key : suite_keys()) names.push_back(key.name.c_str());
  const SchemaSection top(file, document, "suite", names);
  Suite suite;
  suite.file = file;
  if (top.has("reference")) refuse_clips(top);
  for (const SuiteKey& key : suite_keys())
    if (suite.references.empty() || !is_led_by_clips(key)) key.read(top, suite);
  if (origin == Origin::kUser) require_known_engines(top, suite);
  check_whole(top, suite);
  return suite;
}

// Sets document[a][b]... = value for the key "a.b...". Names of readings have a dot of their own.
void apply_override(const YAML::Node& document, const std::string& key, const std::string& value,
                    const std::string& file) {
  YAML::Node node(document);  // yaml-cpp nodes are references; reset() points one elsewhere
  std::string rest = key;
  for (size_t dot = rest.find('.'); dot != std::string::npos; dot = rest.find('.')) {
    const std::string head = rest.substr(0, dot);
    const YAML::Node child = node[head];
    node.reset(child);
    rest = rest.substr(dot + 1);
    if (head == "readings") break;
  }
  node[rest] = parse_yaml(value, file);
}

Suite read_with(const std::string& yaml, const std::string& name, const Overrides& overrides,
                Origin origin = Origin::kUser) {
  const YAML::Node document = parse_yaml(yaml, name);
  if (!document.IsMap())
    throw InputError(fmt::format("{}:1: expected a suite (a mapping), found {}", name, describe(document)));
  for (const auto& [key, value] : overrides) {
    try {
      apply_override(document, key, value, name);
    } catch (const YAML::Exception& error) {
      throw InputError(fmt::format("{}:1: {}", name, error.msg));
    }
  }
  return read_suite(document, name, origin);
}

// The message of the suite without one of its overrides; "" where it is in order.
std::string message_without(std::size_t left_out, const std::string& yaml, const std::string& name,
                            Overrides overrides) {
  overrides.erase(overrides.begin() + static_cast<std::ptrdiff_t>(left_out));
  try {
    static_cast<void>(read_with(yaml, name, overrides));
    return "";
  } catch (const std::exception& error) {
    return error.what();
  }
}

// The message without "FILE:LINE: " at its head.
std::string without_place(const std::string& message, const std::string& file) {
  if (!message.starts_with(file + ":")) return message;
  const std::size_t digits = message.find_first_not_of("0123456789", file.size() + 1);
  if (digits == std::string::npos || digits == file.size() + 1 || !message.substr(digits).starts_with(": "))
    return message;
  return message.substr(digits + 2);
}

// An override has no line in the file: the one without which the message goes away or changes takes its place.
std::string blamed(const std::string& message, const std::string& yaml, const std::string& name,
                   const Overrides& overrides) {
  for (std::size_t i = overrides.size(); i-- > 0;)
    if (message_without(i, yaml, name, overrides) != message)
      return fmt::format("override '{}={}': {}", overrides[i].first, excerpt(overrides[i].second),
                         without_place(message, name));
  return message;
}

}  // namespace

std::string resolved_yaml(const Suite& suite) {
  const SuiteKey::With other = suite.references.empty() ? SuiteKey::With::kReference : SuiteKey::With::kClips;
  std::string text;
  for (const SuiteKey& key : suite_keys())
    if (key.with != other) text += written(key, suite);
  return text;
}

Suite parse_suite(const std::string& yaml, const std::string& name, const Overrides& overrides) {
  try {
    return read_with(yaml, name, overrides);
  } catch (const InputError& error) {
    throw InputError(blamed(error.what(), yaml, name, overrides));
  }
}

Suite parse_run_suite(const std::string& yaml, const std::string& name) {
  return read_with(yaml, name, {}, Origin::kRun);
}

Suite load_suite(const std::string& path, const Overrides& overrides) {
  return parse_suite(read_text(path), path, overrides);
}

}  // namespace duet
