#include "duet/backends/engine_module.h"

#include <dlfcn.h>
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <map>
#include <mutex>
#include <stdexcept>

#include "duet/core/named_table.h"
#include "duet/core/names.h"
#include "duet/core/require.h"
#include "duet/core/share.h"

namespace duet {
namespace {

namespace fs = std::filesystem;

constexpr std::array kEngines = {"mujoco", "bullet", "ode", "simbody", "dart", "mujoco3", "physx"};
constexpr std::string_view kPrefix = "duet_", kSuffix = ".so";

// "a:b" -> a, b.
std::vector<fs::path> folders_of(std::string_view list) {
  std::vector<fs::path> folders;
  for (std::size_t begin = 0; begin <= list.size();) {
    const std::size_t end = std::min(list.find(':', begin), list.size());
    if (end > begin) folders.emplace_back(list.substr(begin, end - begin));
    begin = end + 1;
  }
  return folders;
}

// The first folder of duet's own modules that is there: an installed program looks into no other.
std::vector<fs::path> module_folders() {
  if (const char* set = std::getenv("DUET_ENGINES"); set != nullptr && *set != '\0') return folders_of(set);
  std::error_code error;
  std::vector<fs::path> places = {fs::read_symlink("/proc/self/exe", error).parent_path() / "engines"};
  for (const std::string& prefix : installed_prefixes()) places.push_back(fs::path(prefix) / DUET_INSTALLED_ENGINES);
  for (const fs::path& place : places)
    if (fs::is_directory(place, error)) return {place};
  static const std::optional<BuildTree> built_in = build_tree_of(program_file());
  if (built_in) return {fs::path(built_in->build) / "engines"};
  return {};
}

struct Loaded {
  const EngineModule* module = nullptr;
  std::string reason;  // why it cannot be used; "" where it can
};

std::string last_error() {
  const char* error = dlerror();
  return error == nullptr ? "unknown error of the dynamic linker" : error;
}

Loaded load_file(const std::string& name, const fs::path& file) {
  void* handle = dlopen(file.c_str(), RTLD_NOW | RTLD_LOCAL);
  if (handle == nullptr) return {nullptr, last_error()};
  const auto entry = reinterpret_cast<const EngineModule* (*)()>(dlsym(handle, "duet_engine_module"));
  if (entry == nullptr) return {nullptr, last_error()};
  const EngineModule* module = entry();
  if (module->interface != engine_interface())
    return {nullptr,
            fmt::format("{} was compiled against other types (interface {:016x}, duet {} has {:016x}): compile "
                        "it again with the headers and the compiler flags of this duet",
                        file.string(), module->interface, duet_version(), engine_interface())};
  if (name != module->name) return {nullptr, fmt::format("its module names itself '{}'", module->name)};
  return {module, module->absence == nullptr ? "" : module->absence()};
}

Loaded load(const std::string& name) {
  const std::string file = fmt::format("{}{}{}", kPrefix, name, kSuffix);
  for (const fs::path& folder : module_folders()) {
    std::error_code error;
    if (fs::exists(folder / file, error)) return load_file(name, folder / file);
  }
  if (const char* set = std::getenv("DUET_ENGINES"); set != nullptr && *set != '\0')
    return {nullptr,
            fmt::format("no {} in the folders of DUET_ENGINES ('{}'), which take the place of duet's own", file, set)};
  return {nullptr, fmt::format("{} was not built (its development files were missing, or it was left out)", file)};
}

const Loaded& loaded(const std::string& name) {
  static std::mutex mutex;
  static std::map<std::string, Loaded> modules;
  const std::lock_guard lock(mutex);
  const auto [entry, is_new] = modules.try_emplace(name);
  if (is_new) entry->second = load(name);
  return entry->second;
}

// Names of engines: our own, whether their modules are here or not, then what else has a module.
std::vector<std::string> engine_names() {
  std::vector<std::string> names(kEngines.begin(), kEngines.end());
  std::vector<std::string> others;
  for (const fs::path& folder : module_folders()) {
    std::error_code error;
    for (const fs::directory_entry& entry : fs::directory_iterator(folder, error)) {
      std::string name = entry.path().filename().string();
      if (!name.starts_with(kPrefix) || !name.ends_with(kSuffix)) continue;
      name = name.substr(kPrefix.size(), name.size() - kPrefix.size() - kSuffix.size());
      if (std::find(names.begin(), names.end(), name) == names.end()) others.push_back(name);
    }
  }
  std::sort(others.begin(), others.end());
  others.erase(std::unique(others.begin(), others.end()), others.end());
  names.insert(names.end(), others.begin(), others.end());
  return names;
}

void check_name(const std::string& engine) {
  const std::vector<std::string> names = engine_names();
  require_known("engine", engine, names);
}

}  // namespace

std::vector<EngineInfo> engines() {
  std::vector<EngineInfo> infos;
  for (const std::string& name : engine_names()) {
    const Loaded& engine = loaded(name);
    const bool available = engine.reason.empty();
    infos.push_back({.name = name,
                     .available = available,
                     .version = available ? engine.module->version() : "",
                     .reason = engine.reason,
                     .module = engine.module});
  }
  return infos;
}

const EngineModule& engine_module(const std::string& engine) {
  check_name(engine);
  const Loaded& entry = loaded(engine);
  if (!entry.reason.empty()) throw MissingError(fmt::format("engine '{}' is absent: {}", engine, entry.reason));
  return *entry.module;
}

const EngineModule* find_engine_module(const std::string& engine) {
  const std::vector<std::string> names = engine_names();
  if (std::ranges::find(names, engine) == names.end()) return nullptr;
  const Loaded& entry = loaded(engine);
  return entry.reason.empty() ? entry.module : nullptr;
}

std::string refusal_of(const std::string& engine, PartnerMode partner) {
  const EngineModule* module = find_engine_module(engine);
  if (module == nullptr || partner != PartnerMode::kSolid || *module->no_solid_partner == '\0') return "";
  return fmt::format("engine '{}' has no solid partner ({}): expected the partner ghost or none", engine,
                     module->no_solid_partner);
}

std::unique_ptr<Backend> make_backend(const std::string& engine, const Scene& scene) {
  const EngineModule& module = engine_module(engine);
  check_options(engine, scene.options, module.options);
  if (const std::string refusal = refusal_of(engine, scene.partner); !refusal.empty()) throw MissingError(refusal);
  return module.make(scene);
}

namespace {

const EngineOption& find(std::span<const EngineOption> known, std::string_view name) {
  for (const EngineOption& option : known)
    if (option.name == name) return option;
  throw std::logic_error(fmt::format("no engine option '{}'", name));
}

template <typename T>
EngineOption option_of(const FieldDoc& words, const std::string& fallback) {
  const auto text = [name = words.name, fallback](const EngineOptions& options) {
    return option_or(options, name, fallback);
  };
  const auto assign = [words](EngineOptions& options, const std::string& given) {
    T value{};
    std::string expected = assign_field(words, given, words.range, value);
    if (expected.empty()) options[words.name] = given;
    return expected;
  };
  return field<EngineOptions>(words, field_values<T>(words, words.range), text, assign);
}

}  // namespace

EngineOption number_option(std::string name, double value, double low, double high, std::string meaning) {
  return option_of<double>({.name = std::move(name), .meaning = std::move(meaning), .range = {low, high}},
                           fmt::format("{}", value));
}

EngineOption integer_option(std::string name, int value, int low, int high, std::string meaning) {
  const FieldRange range = {static_cast<double>(low), static_cast<double>(high)};
  return option_of<int>({.name = std::move(name), .meaning = std::move(meaning), .range = range},
                        fmt::format("{}", value));
}

EngineOption choice_option(std::string name, std::vector<std::string> choices, std::string meaning) {
  const std::string first = choices.front();
  return option_of<std::string>({.name = std::move(name), .meaning = std::move(meaning), .choices = std::move(choices)},
                                first);
}

void check_options(std::string_view engine, const EngineOptions& options, std::span<const EngineOption> known) {
  static_cast<void>(read_options("engine", engine, FieldTable<EngineOptions>(known.begin(), known.end()), options));
}

double option_number(const EngineOptions& options, std::span<const EngineOption> known, std::string_view name) {
  double value = std::nan("");
  assign_value({}, find(known, name).text(options), {}, value);
  return value;
}

int option_integer(const EngineOptions& options, std::span<const EngineOption> known, std::string_view name) {
  return static_cast<int>(option_number(options, known, name));
}

std::string option_choice(const EngineOptions& options, std::span<const EngineOption> known, std::string_view name) {
  return find(known, name).text(options);
}

}  // namespace duet
