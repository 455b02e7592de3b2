#include "duet/backends/factory.h"

#include <dlfcn.h>
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cstdlib>
#include <filesystem>
#include <map>
#include <mutex>

#include "duet/core/build_tree.h"
#include "duet/core/names.h"
#include "duet/core/require.h"
#include "duet/core/share.h"
#include "duet/core/version.h"

namespace duet {
namespace {

namespace fs = std::filesystem;

constexpr std::array kEngines = {"mujoco", "bullet", "ode", "simbody", "dart"};
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
  std::string reason;  // where null
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
  return {module, ""};
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

// Names of engines: the benchmark's, then what else has a module.
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
  require(std::find(names.begin(), names.end(), engine) != names.end(), unknown_name_message("engine", engine, names));
}

}  // namespace

std::vector<EngineInfo> engines() {
  std::vector<EngineInfo> infos;
  for (const std::string& name : engine_names()) {
    const Loaded& engine = loaded(name);
    const bool available = engine.module != nullptr;
    infos.push_back({.name = name,
                     .available = available,
                     .version = available ? engine.module->version() : "",
                     .reason = engine.reason});
  }
  return infos;
}

const EngineModule& engine_module(const std::string& engine) {
  check_name(engine);
  const Loaded& entry = loaded(engine);
  if (entry.module == nullptr) throw MissingError(fmt::format("engine '{}' is absent: {}", engine, entry.reason));
  return *entry.module;
}

const EngineModule* find_engine_module(const std::string& engine) {
  const std::vector<std::string> names = engine_names();
  return std::ranges::find(names, engine) == names.end() ? nullptr : loaded(engine).module;
}

std::unique_ptr<Backend> make_backend(const std::string& engine, const Scene& scene) {
  const EngineModule& module = engine_module(engine);
  check_options(engine, scene.options, module.options);
  return module.make(scene);
}

}  // namespace duet
