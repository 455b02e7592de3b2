#include "backends/factory.h"

#include <dlfcn.h>
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cstdlib>
#include <filesystem>
#include <map>
#include <mutex>

#include "backends/playback/playback.h"
#include "core/names.h"
#include "core/require.h"

namespace duet {
namespace {

namespace fs = std::filesystem;

constexpr const char* kPlayback = "playback";
constexpr std::array kEngines = {"mujoco", "bullet", "ode", "simbody", "dart"};
constexpr std::string_view kPrefix = "duet_", kSuffix = ".so";

std::vector<fs::path> module_folders() {
  if (const char* set = std::getenv("DUET_ENGINES"); set != nullptr && *set != '\0') return {set};
  std::error_code error;
  const fs::path program = fs::read_symlink("/proc/self/exe", error);
  return {program.parent_path() / "engines", DUET_BUILD_ENGINES};
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
  if (module->interface != kEngineInterface)
    return {nullptr, fmt::format("its module was built for interface {}, this program has {}", module->interface,
                                 kEngineInterface)};
  if (name != module->name) return {nullptr, fmt::format("its module names itself '{}'", module->name)};
  return {module, ""};
}

Loaded load(const std::string& name) {
  const std::string file = fmt::format("{}{}{}", kPrefix, name, kSuffix);
  for (const fs::path& folder : module_folders()) {
    std::error_code error;
    if (fs::exists(folder / file, error)) return load_file(name, folder / file);
  }
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

// Names of physics engines: the benchmark's, then what else has a module.
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
  std::vector<std::string> names = engine_names();
  names.insert(names.begin(), kPlayback);
  require(std::find(names.begin(), names.end(), engine) != names.end(), unknown_name_message("engine", engine, names));
}

}  // namespace

std::vector<EngineInfo> engines() {
  std::vector<EngineInfo> infos = {
      {.name = kPlayback, .available = true, .version = "1", .reason = "", .physics = false}};
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
  require(engine != kPlayback, "playback is no physics engine");
  const Loaded& entry = loaded(engine);
  if (entry.module == nullptr) throw MissingError(fmt::format("engine '{}' is absent: {}", engine, entry.reason));
  return *entry.module;
}

std::unique_ptr<Backend> make_backend(const std::string& engine, const Scene& scene) {
  check_name(engine);
  if (engine == kPlayback) {
    check_options(engine, scene.options, {});
    return make_playback_backend(scene);
  }
  const EngineModule& module = engine_module(engine);
  check_options(engine, scene.options, module.options);
  return module.make(scene);
}

}  // namespace duet
