#include "backends/factory.h"

#include "backends/mujoco/mujoco.h"
#include "backends/playback/playback.h"
#include "core/names.h"
#include "core/require.h"

namespace duet {
namespace {

struct Engine {
  EngineInfo (*info)();
  std::unique_ptr<Backend> (*make)(const Scene&);
};

EngineInfo playback_info() { return {.name = "playback", .available = true, .version = "1", .reason = ""}; }

constexpr Engine kEngines[] = {
    {playback_info, make_playback_backend},
    {mujoco_info, make_mujoco_backend},
};

}  // namespace

std::vector<EngineInfo> engines() {
  std::vector<EngineInfo> infos;
  for (const Engine& engine : kEngines) infos.push_back(engine.info());
  return infos;
}

std::unique_ptr<Backend> make_backend(const std::string& engine, const Scene& scene) {
  std::vector<std::string> names;
  for (const Engine& known : kEngines) {
    const EngineInfo info = known.info();
    if (info.name == engine) return known.make(scene);
    names.push_back(info.name);
  }
  throw std::invalid_argument(unknown_name_message("engine", engine, names));
}

}  // namespace duet
