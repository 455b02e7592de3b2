#include "controllers/published.h"

#include <fmt/format.h>

#include <cstdlib>
#include <filesystem>

#include "controllers/descriptor_controller.h"
#include "core/names.h"
#include "core/require.h"
#include "core/share.h"

namespace duet {
namespace {

std::string setting(const char* name) {
  const char* value = std::getenv(name);
  return value == nullptr ? "" : value;
}

std::vector<std::string> network_places(const std::string& file) {
  namespace fs = std::filesystem;
  std::vector<std::string> places;
  if (const std::string models = setting("DUET_MODELS"); !models.empty())
    places.push_back((fs::path(models) / file).string());
  const std::string shared = setting("DUET_SHARED");
  const fs::path root = shared.empty() ? fs::path(DUET_SOURCE_DIR) / ".." / "shared" : fs::path(shared);
  places.push_back((root / "models" / file).lexically_normal().string());
  return places;
}

}  // namespace

Descriptor load_descriptor(const std::string& name) {
  if (name.ends_with(".yaml")) return read_descriptor(name);
  return read_descriptor(share_file("IO descriptor", fmt::format("controllers/descriptors/{}.yaml", name)));
}

std::string find_network(const Descriptor& descriptor, const ControllerOptions& options) {
  const auto given = options.find("network");
  const std::vector<std::string> places =
      given == options.end() ? network_places(descriptor.network) : std::vector<std::string>{given->second};
  try {
    return first_existing(fmt::format("network of the controller '{}'", descriptor.name), places);
  } catch (const MissingError& error) {
    throw MissingError(fmt::format("{} (the option 'network' or DUET_MODELS says where it is)", error.what()));
  }
}

std::unique_ptr<Controller> make_published(const std::string& name, std::shared_ptr<const RobotModel> robot,
                                           const ControllerOptions& options) {
  const Descriptor descriptor = load_descriptor(name);
  const std::string path = find_network(descriptor, options);
  return make_descriptor_controller(descriptor, std::move(robot),
                                    load_network(path, option_or(options, "engine", "duet")), path, options);
}

}  // namespace duet
