#include "duet/policies/external/external_policy.h"

#include <fmt/format.h>

#include <charconv>
#include <filesystem>
#include <set>

#include "duet/core/names.h"
#include "duet/core/require.h"
#include "duet/core/share.h"
#include "duet/nn/load_network.h"
#include "duet/policies/external/channel_values.h"
#include "duet/policies/external/child_process.h"
#include "duet/policies/external/descriptor.h"
#include "duet/policies/external/onnx_policy.h"
#include "duet/policies/external/plan_decoder.h"
#include "duet/policies/external/process_policy.h"

namespace duet {
namespace {

int milliseconds_of(const PolicyDescriptor& descriptor, const PolicyOptions& options, const char* name, int fallback) {
  const auto it = options.find(name);
  if (it == options.end()) return fallback;
  int value = 0;
  const char* end = it->second.data() + it->second.size();
  const auto [rest, error] = std::from_chars(it->second.data(), end, value);
  require(error == std::errc() && rest == end && value >= 1 && value <= kMostMilliseconds,
          fmt::format("policy '{}': {}: expected a whole number in [1, {}], found '{}'", descriptor.name, name,
                      kMostMilliseconds, it->second));
  return value;
}

std::shared_ptr<const LanguageEncoder> language_of(const PolicyDescriptor& descriptor, const PolicyOptions& options) {
  if (!shows_language(descriptor)) return nullptr;
  const std::string table = option_or(options, "language");
  return table.empty() ? built_in_language() : load_language_table(table);
}

std::string network_path(const PolicyDescriptor& descriptor, const PolicyOptions& options) {
  const std::string beside = (std::filesystem::path(descriptor.folder()) / descriptor.network).string();
  return first_existing(fmt::format("network of the policy '{}'", descriptor.name),
                        {option_or(options, "network", beside)});
}

// A word of the command that is a path below the descriptor's folder; another one is the machine's.
bool is_beside(const PolicyDescriptor& descriptor, const std::string& word) {
  const std::filesystem::path path = std::filesystem::path(word).lexically_normal();
  if (path.empty() || path.is_absolute() || *path.begin() == "..") return false;
  return std::filesystem::is_regular_file(std::filesystem::path(descriptor.folder()) / path);
}

// What the command names beside the descriptor, and the other files of the same kind there: a script loads its modules
// without naming them. From the descriptor's folder, sorted.
std::set<std::string> command_files(const PolicyDescriptor& descriptor) {
  namespace fs = std::filesystem;
  std::set<std::string> files;
  for (const std::string& word : descriptor.command) {
    if (!is_beside(descriptor, word)) continue;
    const fs::path named = fs::path(word).lexically_normal();
    files.insert(named.generic_string());
    if (!named.has_extension()) continue;
    for (const fs::directory_entry& entry :
         fs::directory_iterator((fs::path(descriptor.folder()) / named).parent_path()))
      if (entry.is_regular_file() && entry.path().extension() == named.extension())
        files.insert((named.parent_path() / entry.path().filename()).generic_string());
  }
  return files;
}

PolicyMaker onnx_maker(const PolicyDescriptor& descriptor, const std::shared_ptr<const RobotModel>& robot,
                       const PolicyOptions& options) {
  const std::string path = network_path(descriptor, options);
  const std::string engine = option_or(options, "engine", "duet");
  const auto make = [=, language = language_of(descriptor, options)] {
    return make_onnx_policy(descriptor, robot, load_network(path, engine), path, language);
  };
  static_cast<void>(make());  // what cannot be made is refused now, not in every episode
  return make;
}

PolicyMaker process_maker(PolicyDescriptor descriptor, const std::shared_ptr<const RobotModel>& robot,
                          const PolicyOptions& options) {
  descriptor.deadline_ms = milliseconds_of(descriptor, options, "deadline_ms", descriptor.deadline_ms);
  descriptor.hang_ms = milliseconds_of(descriptor, options, "hang_ms", descriptor.hang_ms);
  descriptor.start_ms = milliseconds_of(descriptor, options, "start_ms", descriptor.start_ms);
  static_cast<void>(PlanDecoder(descriptor, robot, bind_joints(descriptor, *robot)));
  if (!descriptor.command.empty()) static_cast<void>(find_program(descriptor.command[0], descriptor.folder()));
  return [=] { return make_process_policy(descriptor, robot); };
}

}  // namespace

PolicyInfo external_info(const std::string& name) {
  const PolicyDescriptor descriptor = read_policy_descriptor(name);
  PolicyInfo info{.name = descriptor.name, .about = descriptor.about, .options = {}};
  if (descriptor.kind == PolicyKind::kOnnx)
    info.options = {{"network", descriptor.network, "path of the network's file"},
                    {"engine", "duet", "what evaluates the network"},
                    {"language", "", "NPZ table of prompts and embeddings instead of the built-in encoder"}};
  else
    info.options = {{"deadline_ms", descriptor.deadline_ms == 0 ? "" : std::to_string(descriptor.deadline_ms),
                     "for a plan; later it is left out; none: duet waits"},
                    {"hang_ms", std::to_string(descriptor.hang_ms), "for a plan without a deadline; then it is dead"},
                    {"start_ms", std::to_string(descriptor.start_ms), "for the answers to hello and reset"}};
  return info;
}

LoadedFiles external_files(const std::string& name, const PolicyOptions& options) {
  const PolicyDescriptor descriptor = read_policy_descriptor(name);
  LoadedFiles files = {{"descriptor", name}};
  if (descriptor.kind == PolicyKind::kOnnx)
    for (LoadedFile& file : network_files(network_path(descriptor, options))) files.push_back(std::move(file));
  if (const std::string language = option_or(options, "language"); !language.empty())
    files.push_back({"language", language});
  for (const std::string& file : command_files(descriptor))
    files.push_back({"command " + file, (std::filesystem::path(descriptor.folder()) / file).string()});
  return files;
}

PolicyMaker external_maker(
    const std::string& name,
    std::shared_ptr<const RobotModel> robot,  // NOLINT(performance-unnecessary-value-param): as all makers
    const PolicyOptions& options) {
  require(robot != nullptr, fmt::format("policy '{}' needs a robot", name));
  const PolicyDescriptor descriptor = read_policy_descriptor(name);
  return descriptor.kind == PolicyKind::kOnnx ? onnx_maker(descriptor, robot, options)
                                              : process_maker(descriptor, robot, options);
}

}  // namespace duet
