#include "duet/controllers/catalogue/published.h"

#include <fmt/format.h>

#include <cstdlib>
#include <filesystem>

#include "duet/controllers/descriptor_controller.h"
#include "duet/controllers/network_facts.h"
#include "duet/core/names.h"
#include "duet/core/require.h"
#include "duet/core/share.h"
#include "duet/nn/load_network.h"

namespace duet {
namespace {

std::string setting(const char* name) {
  const char* value = std::getenv(name);
  return value == nullptr ? "" : value;
}

std::vector<std::string> network_places(const Descriptor& descriptor) {
  namespace fs = std::filesystem;
  std::vector<std::string> places = {(fs::path(descriptor.file).parent_path() / descriptor.network).string()};
  if (const std::string models = setting("DUET_MODELS"); !models.empty())
    places.push_back((fs::path(models) / descriptor.network).string());
  if (const std::string shared = setting("DUET_SHARED"); !shared.empty())
    places.push_back((fs::path(shared) / "models" / descriptor.network).string());
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
      given == options.end() ? network_places(descriptor) : std::vector<std::string>{given->second};
  try {
    return first_existing(fmt::format("network of the controller '{}'", descriptor.name), places);
  } catch (const MissingError& error) {
    throw MissingError(fmt::format("{} (the option 'network' or DUET_MODELS says where it is)", error.what()));
  }
}

LoadedFiles published_files(const std::string& name, const ControllerOptions& options) {
  const Descriptor descriptor = load_descriptor(name);
  LoadedFiles files = {{"descriptor", descriptor.file}};
  for (LoadedFile& file : network_files(find_network(descriptor, options))) files.push_back(std::move(file));
  return files;
}

ToldLoader load_told(const std::string& name, std::shared_ptr<const RobotModel> robot,
                     const ControllerOptions& options) {
  const Descriptor descriptor = load_descriptor(name);
  const std::string path = find_network(descriptor, options);
  const NetworkFile network = load_network_file(path, option_or(options, "engine", "duet"));
  return {[=, robot = std::move(robot), make = network.make](const ControllerOptions& now,
                                                             std::shared_ptr<const VelocityCommand> told) {
            return make_descriptor_controller(descriptor, robot, make(), path, now, std::move(told));
          },
          compare_with_network(descriptor, network.metadata, path)};
}

}  // namespace duet
