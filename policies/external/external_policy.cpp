#include "duet/policies/external/external_policy.h"

#include <fmt/format.h>

#include <filesystem>
#include <optional>
#include <set>

#include "duet/core/option.h"
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

// The options of a network that a suite may set; "" where it is the descriptor's, or built in.
struct OnnxOptions {
  std::string network, engine = "duet", language;
};

const FieldTable<OnnxOptions>& onnx_options() {
  using O = OnnxOptions;
  static const FieldTable<O> table = {
      field<O>({.name = "network", .meaning = "path of the network's file"}, &O::network),
      field<O>({.name = "engine", .meaning = "what evaluates the network"}, &O::engine),
      field<O>({.name = "language", .meaning = "NPZ table of prompts and embeddings instead of the built-in encoder"},
               &O::language)};
  return table;
}

struct ProcessOptions {
  std::optional<int> deadline_ms;
  int hang_ms = 0, start_ms = 0;
};

const FieldTable<ProcessOptions>& process_options() {
  using O = ProcessOptions;
  constexpr FieldRange kWait = {1.0, kMostMilliseconds};
  static const FieldTable<O> table = {
      field<O>({.name = "deadline_ms",
                .meaning = "for a plan; later it is left out; none: duet waits",
                .unit = "ms",
                .range = kWait},
               &O::deadline_ms),
      field<O>({.name = "hang_ms",
                .meaning = "for a plan without a deadline; then it is dead",
                .unit = "ms",
                .range = kWait},
               &O::hang_ms),
      field<O>({.name = "start_ms", .meaning = "for the answers to hello and reset", .unit = "ms", .range = kWait},
               &O::start_ms)};
  return table;
}

ProcessOptions waits_of(const PolicyDescriptor& descriptor) {
  return {.deadline_ms = descriptor.deadline_ms == 0 ? std::nullopt : std::optional<int>(descriptor.deadline_ms),
          .hang_ms = descriptor.hang_ms,
          .start_ms = descriptor.start_ms};
}

std::shared_ptr<const LanguageEncoder> language_of(const PolicyDescriptor& descriptor, const OnnxOptions& options) {
  if (!shows_language(descriptor)) return nullptr;
  return options.language.empty() ? built_in_language() : load_language_table(options.language);
}

std::string network_path(const PolicyDescriptor& descriptor, const OnnxOptions& options) {
  const std::string beside = (std::filesystem::path(descriptor.folder()) / descriptor.network).string();
  return first_existing(fmt::format("network of the policy '{}'", descriptor.name),
                        {options.network.empty() ? beside : options.network});
}

// A word of the command that is a path below the descriptor's folder; another one is the machine's.
bool is_beside(const PolicyDescriptor& descriptor, const std::string& word) {
  const std::filesystem::path path = std::filesystem::path(word).lexically_normal();
  if (path.empty() || path.is_absolute() || *path.begin() == "..") return false;
  return std::filesystem::is_regular_file(std::filesystem::path(descriptor.folder()) / path);
}

// The files that the command names beside the descriptor, and the others of the same kind there: a script loads its
// modules without naming them. From the descriptor's folder, sorted.
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
                       const PolicyOptions& given) {
  const OnnxOptions options = read_options("policy", descriptor.name, onnx_options(), given);
  const std::string path = network_path(descriptor, options);
  const auto make = [=, network = load_network_file(path, options.engine).make,
                     language = language_of(descriptor, options)] {
    return make_onnx_policy(descriptor, robot, network(), path, language);
  };
  static_cast<void>(make());  // what cannot be made is refused now, not in every episode
  return make;
}

PolicyMaker process_maker(PolicyDescriptor descriptor, const std::shared_ptr<const RobotModel>& robot,
                          const PolicyOptions& given) {
  const ProcessOptions waits = read_options("policy", descriptor.name, process_options(), given, waits_of(descriptor));
  descriptor.deadline_ms = waits.deadline_ms.value_or(0);
  descriptor.hang_ms = waits.hang_ms;
  descriptor.start_ms = waits.start_ms;
  static_cast<void>(PlanDecoder(descriptor, robot, bind_joints(descriptor, *robot)));
  if (!descriptor.command.empty()) static_cast<void>(find_program(descriptor.command[0], descriptor.folder()));
  return [=] { return make_process_policy(descriptor, robot); };
}

}  // namespace

std::vector<PolicyOption> external_options(const PolicyDescriptor& descriptor) {
  if (descriptor.kind == PolicyKind::kProcess)
    return option_list<PolicyOption>(process_options(), waits_of(descriptor));
  return option_list<PolicyOption>(onnx_options(), {.network = descriptor.network, .language = ""});
}

PolicyInfo external_info(const std::string& name) {
  const PolicyDescriptor descriptor = read_policy_descriptor(name);
  return {.name = descriptor.name, .about = descriptor.about, .options = external_options(descriptor)};
}

LoadedFiles external_files(const std::string& name, const PolicyOptions& given) {
  const PolicyDescriptor descriptor = read_policy_descriptor(name);
  LoadedFiles files = {{"descriptor", name}};
  if (descriptor.kind == PolicyKind::kOnnx) {
    const OnnxOptions options = read_options("policy", descriptor.name, onnx_options(), given);
    for (LoadedFile& file : network_files(network_path(descriptor, options))) files.push_back(std::move(file));
    if (!options.language.empty()) files.push_back({"language", options.language});
  }
  for (const std::string& file : command_files(descriptor))
    files.push_back({"command " + file, (std::filesystem::path(descriptor.folder()) / file).string()});
  return files;
}

PolicyMaker external_maker(
    const std::string& name,
    std::shared_ptr<const RobotModel> robot,  // NOLINT(performance-unnecessary-value-param): as all makers
    const PolicyOptions& options) {
  require(robot != nullptr, "policy '{}' needs a robot", name);
  const PolicyDescriptor descriptor = read_policy_descriptor(name);
  return descriptor.kind == PolicyKind::kOnnx ? onnx_maker(descriptor, robot, options)
                                              : process_maker(descriptor, robot, options);
}

}  // namespace duet
