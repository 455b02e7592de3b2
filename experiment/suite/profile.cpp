#include "duet/experiment/suite/profile.h"

#include <fmt/format.h>

#include <algorithm>
#include <filesystem>

#include "duet/backends/engine_module.h"
#include "duet/core/digest.h"
#include "duet/core/file.h"
#include "duet/core/named_table.h"
#include "duet/core/names.h"
#include "duet/core/require.h"
#include "duet/core/robot_state.h"
#include "duet/core/share.h"
#include "duet/robots/yaml_section.h"

namespace duet {
namespace {

constexpr std::string_view kProfileSchema = "duet.profile/1";

std::vector<std::string> physics_engines() { return names_of(engines()); }

EngineSettings read_settings(const YAML::Node& node, const std::string& engine, const std::string& file) {
  const auto fail = [&](const YAML::Node& at, const std::string& message) {
    throw InputError(fmt::format("{}:{}: {}", file, std::max(at.Mark().line, 0) + 1, message));
  };
  if (!node.IsMap()) fail(node, fmt::format("{}: expected a mapping, found {}", engine, describe(node)));
  const FieldTable<EngineSettings> actuation = actuation_fields<EngineSettings>();
  EngineSettings settings;
  for (const auto& entry : node) {
    const std::string key = entry.first.as<std::string>();
    if (!entry.second.IsScalar())
      fail(entry.first, fmt::format("{}.{}: expected one value, found {}", engine, key, describe(entry.second)));
    const std::string value = entry.second.Scalar();
    if (const Field<EngineSettings>* known = find_field(actuation, key)) {
      const std::string expected = set_field(*known, settings, value);
      if (!expected.empty()) fail(entry.first, fmt::format("{}: {}", engine, field_refusal(*known, expected, value)));
      continue;
    }
    try {
      settings.options[key] = value;
      if (is_available(engine)) check_options(engine, {{key, value}}, engine_module(engine).options);
    } catch (const std::invalid_argument& error) {
      fail(entry.first, fmt::format("{}: {}", engine, error.what()));
    }
  }
  return settings;
}

std::filesystem::path shipped_folder() {
  return std::filesystem::path(share_file("engine profiles", "profiles/parity.yaml")).parent_path();
}

}  // namespace

bool is_available(const std::string& engine) { return find_engine_module(engine) != nullptr; }

EngineSettings Profile::settings(const std::string& engine) const {
  const auto found = engines.find(engine);
  return found == engines.end() ? EngineSettings() : found->second;
}

Profile read_profile(const YAML::Node& document, const std::string& file) {
  const YamlSection top(file, document, "profile", {"schema", "name", "about", "engines"});
  if (top.has("schema")) top.require_schema(kProfileSchema);
  Profile profile{.name = top.text("name"), .about = top.has("about") ? top.text("about") : "", .engines = {}};
  const YAML::Node node = top.node("engines");
  if (!node.IsMap()) top.refuse_key("engines", "a mapping", node);
  const std::vector<std::string> known = physics_engines();
  for (const auto& entry : node) {
    const std::string engine = entry.first.as<std::string>();
    if (std::find(known.begin(), known.end(), engine) == known.end())
      top.fail(entry.first.Mark().line + 1, unknown_name_message("engine", engine, known));
    if (!profile.engines.emplace(engine, read_settings(entry.second, engine, file)).second)
      top.fail(entry.first.Mark().line + 1, fmt::format("engine '{}' is there twice", engine));
  }
  return profile;
}

Profile load_profile(const std::string& profile) {
  const auto load = [](const std::string& file) {
    const YAML::Node document = parse_yaml(read_text(file), file);
    if (!document.IsMap() || !document["schema"])
      throw InputError(fmt::format("{}:1: expected an engine profile with 'schema: {}', found {}", file, kProfileSchema,
                                   document.IsMap() ? "no schema" : describe(document)));
    return read_profile(document, file);
  };
  if (std::filesystem::is_regular_file(profile)) return load(profile);
  const std::vector<std::string> names = profile_names();
  require_known("engine profile (or file)", profile, names);
  return load((shipped_folder() / (profile + ".yaml")).string());
}

std::vector<std::string> profile_names() {
  std::vector<std::string> names;
  for (const auto& entry : std::filesystem::directory_iterator(shipped_folder()))
    if (entry.path().extension() == ".yaml") names.push_back(entry.path().stem().string());
  std::sort(names.begin(), names.end());
  return names;
}

std::string settings_yaml(const EngineSettings& settings) {
  std::string text = fmt::format("{{dt: {}", settings.dt);
  for (const Field<EngineSettings>& known : actuation_fields<EngineSettings>())
    if (const std::string value = known.text(settings); known.name != "dt" && value != known.text(EngineSettings()))
      text += fmt::format(", {}: {}", known.name, value);
  for (const auto& [name, value] : settings.options) text += fmt::format(", {}: {}", name, value);
  return text + "}";
}

std::string resolved_settings(const std::string& engine, const EngineSettings& settings) {
  EngineSettings all = settings;
  if (is_available(engine))
    for (const EngineOption& option : engine_module(engine).options)
      all.options.try_emplace(option.name, option.text({}));
  return settings_yaml(all);
}

std::string settings_digest(const std::string& engine, const EngineSettings& settings) {
  return sha256_hex(fmt::format("{}: {}", engine, resolved_settings(engine, settings)));
}

}  // namespace duet
