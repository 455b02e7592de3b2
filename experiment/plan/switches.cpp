#include "duet/experiment/plan/switches.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <array>
#include <filesystem>
#include <string_view>
#include <utility>

#include "duet/backends/actuation.h"
#include "duet/backends/engine_module.h"
#include "duet/core/named_table.h"
#include "duet/core/require.h"
#include "duet/robots/yaml_section.h"
#include "duet/rows/episode_row.h"
#include "duet/statistics/factorial.h"

namespace duet {
namespace {

constexpr const char* kEngineSwitch = "engine";

// The meaning of a key, whatever the engine calls it. A key that is not here is a switch of its own.
struct KeyGroup {
  std::string_view name;
  std::array<std::string_view, 10> keys;
};
constexpr std::array<KeyGroup, 8> kGroups = {{
    {"law", {"law"}},
    {"armature", {"armature"}},
    {"dt", {"dt"}},
    {"softness",
     {"ground_time_constant", "erp", "push_out", "slop", "contact_erp", "contact_cfm", "contact_stiffness",
      "contact_damping", "recovery_speed", "cfm"}},
    {"friction", {"cone", "impratio", "friction", "friction_passes"}},
    {"solver", {"solver", "iterations", "tolerance", "jacobian", "integrator", "sweeps", "pgs_iterations"}},
    {"stops", {"stop_erp", "stop_cfm"}},
    {"hinges", {"joint_erp", "joint_cfm"}},
}};

std::size_t rank_of(const std::string& name) {
  return static_cast<std::size_t>(std::ranges::find(kGroups, name, &KeyGroup::name) - kGroups.begin());
}

bool same_value(const std::optional<std::string>& a, const std::optional<std::string>& b) {
  if (a == b) return true;
  const std::optional<double> x = a ? parse_number(*a) : std::nullopt, y = b ? parse_number(*b) : std::nullopt;
  return x && y && *x == *y;
}

using Settings = std::map<std::string, std::optional<std::string>>;

// Every setting of an engine under a profile, with its defaults where the engine is there.
Settings settings_of(const Profile& profile, const std::string& engine) {
  Settings settings;
  for (const auto& entry : YAML::Load(resolved_settings(engine, profile.settings(engine))))
    settings[entry.first.Scalar()] = entry.second.Scalar();
  for (const Field<EngineSettings>& known : actuation_fields<EngineSettings>())
    settings[known.name] = known.text(profile.settings(engine));
  return settings;
}

// The profile with these settings, checked as one of a file.
Profile profile_with(const std::string& name, const std::map<std::string, Settings>& engines, const std::string& file) {
  YAML::Node document;
  document["name"] = name;
  document["engines"] = YAML::Node(YAML::NodeType::Map);
  for (const auto& [engine, settings] : engines) {
    document["engines"][engine] = YAML::Node(YAML::NodeType::Map);
    for (const auto& [key, value] : settings)
      if (value) document["engines"][engine][key] = *value;
  }
  const std::string text = YAML::Dump(document);
  try {
    return read_profile(parse_yaml(text, file), file);
  } catch (const InputError& error) {  // nobody wrote these lines: the number of one says nothing
    std::string said = error.what();
    if (said.starts_with(file + ':'))
      said.erase(file.size(), said.find_first_not_of("0123456789", file.size() + 1) - file.size());
    throw InputError(said);
  }
}

struct InlineSetting {
  std::string engine, key, value;  // engine "": of every engine
};

// "law=explicit,mujoco.cone=pyramidal".
std::vector<InlineSetting> inline_settings(const std::string& text, const std::string& option) {
  std::vector<InlineSetting> list;
  for (const std::string_view part : split(text, ',')) {
    const std::string item(part);
    const std::size_t equals = item.find('=');
    require(equals != std::string::npos && equals > 0 && equals + 1 < item.size(),
            "{}: expected KEY=VALUE between commas, found '{}'", option, excerpt(item));
    const std::string key = item.substr(0, equals);
    const std::size_t dot = key.find('.');
    list.push_back({dot == std::string::npos ? "" : key.substr(0, dot),
                    dot == std::string::npos ? key : key.substr(dot + 1), item.substr(equals + 1)});
  }
  return list;
}

bool has_option(const std::string& engine, const std::string& key) {
  return is_available(engine) && std::ranges::any_of(engine_module(engine).options,
                                                     [&](const EngineOption& option) { return option.name == key; });
}

// The engines that a setting of every engine is for: all, or where one engine takes the place of another those of them
// that have such an option, unless none has.
std::vector<std::string> engines_for(const std::string& key, const std::vector<std::string>& engines, bool replaces) {
  std::vector<std::string> with_it;
  for (const std::string& engine : engines)
    if (has_option(engine, key)) with_it.push_back(engine);
  return replaces && !with_it.empty() ? with_it : engines;
}

bool is_inline(const std::string& text) {
  return text.find('=') != std::string::npos && !std::filesystem::is_regular_file(text);
}

// A side of the comparison; settings stand on `base`.
Profile side_of(const std::string& text, const std::string& option, const Profile& base,
                const std::vector<std::string>& engines, bool replaces) {
  if (text.empty()) return base;
  if (!is_inline(text)) return load_profile(text);
  std::map<std::string, Settings> sides;
  for (const std::string& engine : engines) sides[engine] = settings_of(base, engine);
  for (const InlineSetting& setting : inline_settings(text, option)) {
    if (setting.engine.empty() && setting.key == kEngineSwitch) continue;
    require(setting.engine.empty() || sides.contains(setting.engine),
            "{}: {}.{}: expected an engine that runs ({}), found '{}'", option, setting.engine, setting.key,
            fmt::join(engines, ", "), setting.engine);
    const std::vector<std::string> all = engines_for(setting.key, engines, replaces);
    for (const std::string& engine : setting.engine.empty() ? all : std::vector{setting.engine})
      sides[engine][setting.key] = setting.value;
  }
  return profile_with(text, sides, option);
}

// The value of `engine` among settings; "" where there is none.
std::string engine_in(const std::string& text, const std::string& option) {
  if (!is_inline(text)) return "";
  for (const InlineSetting& setting : inline_settings(text, option))
    if (setting.engine.empty() && setting.key == kEngineSwitch) return setting.value;
  return "";
}

std::string text_of(const std::optional<std::string>& value) { return value.value_or("default"); }

void require_present(const std::string& engine) {
  for (const EngineInfo& known : engines())
    if (known.name == engine && !known.available)
      throw MissingError(fmt::format("engine '{}' is absent: {}", engine, known.reason));
}

}  // namespace

std::string switch_of(const std::string& key) {
  for (const KeyGroup& group : kGroups)
    if (std::ranges::find(group.keys, key) != group.keys.end()) return std::string(group.name);
  return key;
}

std::string EngineSwitch::text() const {
  const auto plain = [](const SettingChange& change) {
    return fmt::format("{} {} -> {}", change.key, text_of(change.from), text_of(change.to));
  };
  std::vector<std::string> texts;
  for (const SettingChange& change : changes) {
    const auto alike =
        std::ranges::count_if(changes, [&](const SettingChange& other) { return plain(other) == plain(change); });
    const bool of_all = alike == static_cast<std::ptrdiff_t>(engines);
    std::string text = of_all || change.engine.empty() ? plain(change) : change.engine + ": " + plain(change);
    if (std::ranges::find(texts, text) == texts.end()) texts.push_back(std::move(text));
  }
  return fmt::format("{}", fmt::join(texts, ", "));
}

SwitchedSuite::SwitchedSuite(Suite suite, const SwitchOptions& options) : suite_(std::move(suite)) {
  std::erase(suite_.engines, kPlaybackEngine);
  if (suite_.engines.empty()) throw InputError("attribution: expected a physics engine, found playback alone");
  suite_.null_arm = false;
  suite_.controls.clear();
  require(engine_in(options.from, "--from").empty(), "--from: expected settings, found 'engine': --to names another");
  other_engine_ = engine_in(options.to, "--to");
  std::vector<std::string> all = suite_.engines;
  if (!other_engine_.empty()) {
    require(all.size() == 1, "--to engine={}: expected one engine that it takes the place of, found {}", other_engine_,
            fmt::join(all, ", "));
    require(other_engine_ != all.front(), "--to engine={}: expected another engine than the suite's", other_engine_);
    all.push_back(other_engine_);
  }
  for (const std::string& engine : all) require_present(engine);
  const Profile from = side_of(options.from, "--from", suite_.profile, all, !other_engine_.empty());
  const Profile to = side_of(options.to, "--to", from, all, !other_engine_.empty());
  Sides from_sides, to_sides;
  for (const std::string& engine : all) {
    from_sides[engine] = settings_of(from, engine);
    to_sides[engine] = settings_of(to, engine);
  }
  take(from_sides, to_sides, options);
}

void SwitchedSuite::take(const Sides& from, const Sides& to, const SwitchOptions& options) {
  from_ = from;
  std::map<std::pair<std::size_t, std::string>, EngineSwitch> found;  // in the order of the groups
  for (const auto& [engine, settings] : from) {
    Settings keys = settings;
    keys.insert(to.at(engine).begin(), to.at(engine).end());
    for (const auto& [key, value] : keys) {
      const auto side = [&key = key](const Settings& of) { return of.contains(key) ? of.at(key) : std::nullopt; };
      const SettingChange change{engine, key, side(settings), side(to.at(engine))};
      if (same_value(change.from, change.to)) continue;
      const auto named = options.names.find(key);
      const std::string name = named == options.names.end() ? switch_of(key) : named->second;
      EngineSwitch& of = found[{rank_of(name), name}];
      of.name = name;
      of.engines = from.size();
      of.changes.push_back(change);
    }
  }
  for (auto& [place, of] : found) switches_.push_back(std::move(of));
  if (!other_engine_.empty())
    switches_.push_back({kEngineSwitch, {{"", kEngineSwitch, suite_.engines.front(), other_engine_}}});
  require(!switches_.empty(), "--from {} and --to {} are the same for {}: nothing is there to attribute", options.from,
          options.to, fmt::join(suite_.engines, ", "));
  require(std::ssize(switches_) <= kMostSwitches,
          "--from {} and --to {} differ in {} switches ({}): expected at most {}; --group NAME=KEY,KEY turns several "
          "settings as one",
          options.from, options.to, switches_.size(), fmt::join(names(), ", "), kMostSwitches);
}

std::vector<std::string> SwitchedSuite::names() const { return names_of(switches_); }

std::string SwitchedSuite::cell_name(unsigned cell) const {
  return cell == 0 ? "from" : cell + 1 == cells() ? "to" : set_name(names(), cell, "+");
}

Suite SwitchedSuite::cell(unsigned cell) const {
  Suite suite = suite_;
  Sides sides = from_;
  for (std::size_t i = 0; i < switches_.size(); ++i) {
    if ((cell >> i & 1U) == 0) continue;
    if (switches_[i].name == kEngineSwitch && !other_engine_.empty()) suite.engines = {other_engine_};
    for (const SettingChange& change : switches_[i].changes)
      if (!change.engine.empty()) sides[change.engine][change.key] = change.to;
  }
  std::erase_if(sides,
                [&](const auto& side) { return std::ranges::find(suite.engines, side.first) == suite.engines.end(); });
  suite.profile = profile_with(cell_name(cell), sides, "cell " + cell_name(cell));
  return suite;
}

}  // namespace duet
