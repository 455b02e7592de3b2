#include "duet/policies/external/external_policy.h"

#include <fmt/format.h>

#include <filesystem>
#include <optional>
#include <set>

#include "duet/core/child_process.h"
#include "duet/core/field.h"
#include "duet/core/require.h"
#include "duet/core/share.h"
#include "duet/io/bound_network.h"
#include "duet/nn/catalogue/load_network.h"
#include "duet/policies/external/channel_values.h"
#include "duet/policies/external/descriptor.h"
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

namespace {

ChannelWidths widths_of(int joints) { return {.joints = joints, .actions = 0}; }

std::vector<LayoutBlock> layout_of(const PolicyInput& input, int joints) {
  LayoutBlock block{.entries = {}, .frames = input.frames};
  for (const Channel& channel : input.channels)
    block.entries.push_back(
        {channel_name(channel.kind, ChannelFormat::kPolicy), channel_size(channel, widths_of(joints))});
  return {block};
}

class OnnxPolicy final : public Policy {
 public:
  OnnxPolicy(const PolicyDescriptor& descriptor, const std::shared_ptr<const RobotModel>& robot,
             std::unique_ptr<Network> network, const std::string& network_path,
             std::shared_ptr<const LanguageEncoder> language)
      : name_(descriptor.name),
        network_(std::move(network), descriptor.file, network_path),
        language_(std::move(language)),
        tasks_(descriptor.tasks),
        inputs_(descriptor.inputs),
        joints_(robot->dof()),
        values_(robot, bind_joints(descriptor, *robot), descriptor),
        decoder_(descriptor, robot, bind_joints(descriptor, *robot)) {
    bind_inputs();
    bind_output(descriptor);
  }

  [[nodiscard]] std::string_view name() const override { return name_; }
  [[nodiscard]] PolicyFaults faults() const override { return faults_; }

  void reset(const EpisodeContext& context) override {
    require_known_task(name_, tasks_, context.task);
    faults_ = {};
    held_ = {context.start.X_WB, context.start.q};
    network_.reset();
    values_.reset(context, language_ == nullptr ? std::vector<float>{} : language_->embed(context.prompt));
  }

  // Where there is no plan: the pose of the last one, at first that of the start.
  Anchors act(const Observation& observation) override {
    const std::vector<Reference> references = plan(observation);
    return anchors_of(references.empty() ? std::vector{held_} : references);
  }

  std::vector<Reference> plan(const Observation& observation) override {
    if (!is_finite(observation))
      return leave_out(faults_, name_, observation.tick, "observation: expected finite numbers, found others");
    for (std::size_t i = 0; i < inputs_.size(); ++i) write(inputs_[i], observation, buffers_[i]);
    network_.run();
    DecodedPlan decoded = decoder_.decode(network_.output(plan_output_), observation.now().robot);
    if (!decoded.fault.empty()) return leave_out(faults_, name_, observation.tick, decoded.fault);
    held_ = decoded.references.front();
    return std::move(decoded.references);
  }

 private:
  void write(const PolicyInput& input, const Observation& observation, std::vector<float>& buffer) {
    const int newest = static_cast<int>(observation.history.size()) - 1;
    std::span<float> rest(buffer);
    for (int i = 0; i < input.frames; ++i) {
      const int frame = input.newest_first ? newest - i : newest - input.frames + 1 + i;
      for (const Channel& channel : input.channels) {
        const std::size_t size = channel_size(channel, widths_of(joints_));
        values_.write(channel, observation, frame, rest.first(size));
        rest = rest.subspan(size);
      }
    }
  }

  void bind_inputs() {
    buffers_.resize(inputs_.size());
    for (std::size_t i = 0; i < inputs_.size(); ++i) {
      const std::vector<LayoutBlock> layout = layout_of(inputs_[i], joints_);
      buffers_[i].resize(layout_size(layout));
      network_.bind_input(inputs_[i].name, inputs_[i].line, buffers_[i], layout);
    }
    network_.require_all_bound();
  }

  void bind_output(const PolicyDescriptor& descriptor) {
    plan_output_ = network_.find_output(descriptor.output.name, descriptor.output.line);
    const Port& port = network_.outputs()[plan_output_];
    if (port.size != decoder_.size())
      throw InputError(fmt::format("{}: output '{}': expected {} numbers ({} anchors of {}), found {}",
                                   network_.place(descriptor.output.line), port.name, decoder_.size(),
                                   descriptor.output.anchors, decoder_.anchor_size(), port.size));
  }

  std::string name_;
  BoundNetwork network_;
  std::shared_ptr<const LanguageEncoder> language_;  // shared between episodes; null where no channel shows it
  std::vector<Task> tasks_;
  std::vector<PolicyInput> inputs_;
  int joints_;
  ChannelValues values_;
  PlanDecoder decoder_;
  std::vector<std::vector<float>> buffers_;  // of inputs_
  int plan_output_ = 0;
  Reference held_;
  PolicyFaults faults_;
};

}  // namespace

bool shows_language(const PolicyDescriptor& descriptor) {
  for (const PolicyInput& input : descriptor.inputs)
    for (const Channel& channel : input.channels)
      if (channel.kind == ChannelKind::kLanguage) return true;
  return false;
}

std::unique_ptr<Policy> make_onnx_policy(const PolicyDescriptor& descriptor,
                                         const std::shared_ptr<const RobotModel>& robot,
                                         std::unique_ptr<Network> network, const std::string& network_path,
                                         std::shared_ptr<const LanguageEncoder> language) {
  require(robot != nullptr && network != nullptr, "policy '{}': expected a robot and a network, found none",
          descriptor.name);
  require(!shows_language(descriptor) || (language != nullptr && language->size() == kLanguageSize),
          "policy '{}': expected a language encoder of {} numbers, found none", descriptor.name, kLanguageSize);
  return std::make_unique<OnnxPolicy>(descriptor, robot, std::move(network), network_path, std::move(language));
}

}  // namespace duet
