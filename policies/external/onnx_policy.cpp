#include "policies/external/onnx_policy.h"

#include <fmt/format.h>

#include <algorithm>

#include "core/names.h"
#include "core/require.h"
#include "policies/external/channel_values.h"
#include "policies/external/plan_decoder.h"

namespace duet {
namespace {

int frame_size(const PolicyInput& input, int joints) {
  int size = 0;
  for (const PolicyChannel& channel : input.channels) size += channel_size(channel, joints);
  return size;
}

// "partner_root 0..2, time 3 (12 frames of 4)": how the size of an input comes about.
std::string layout(const PolicyInput& input, int joints) {
  std::string text;
  int first = 0;
  for (const PolicyChannel& channel : input.channels) {
    const int size = channel_size(channel, joints);
    text += fmt::format("{}{} {}", text.empty() ? "" : ", ", to_string(channel.kind), first);
    if (size > 1) text += fmt::format("..{}", first + size - 1);
    first += size;
  }
  if (input.frames > 1) text += fmt::format(" ({} frames of {})", input.frames, first);
  return text;
}

// The port that `name` names; "" stands for the only one.
std::size_t find_port(std::span<const Port> ports, const std::string& name, const char* kind,
                      const std::string& place) {
  if (name.empty() && ports.size() == 1) return 0;
  std::vector<std::string> known;
  known.reserve(ports.size());
  for (const Port& port : ports) known.push_back(port.name);
  const auto it = std::ranges::find(known, name);
  if (it == known.end()) throw InputError(fmt::format("{}: {}", place, unknown_name_message(kind, name, known)));
  return static_cast<std::size_t>(it - known.begin());
}

class OnnxPolicy final : public Policy {
 public:
  OnnxPolicy(const PolicyDescriptor& descriptor, const std::shared_ptr<const RobotModel>& robot,
             std::unique_ptr<Network> network, const std::string& network_path,
             std::shared_ptr<const LanguageEncoder> language)
      : name_(descriptor.name),
        network_(std::move(network)),
        language_(std::move(language)),
        inputs_(descriptor.inputs),
        joints_(robot->dof()),
        values_(robot, bind_joints(descriptor, *robot), descriptor.frame),
        decoder_(descriptor, robot, bind_joints(descriptor, *robot)) {
    bind_inputs(descriptor, network_path);
    bind_outputs(descriptor, network_path);
  }

  [[nodiscard]] std::string_view name() const override { return name_; }
  [[nodiscard]] PolicyFaults faults() const override { return faults_; }

  void reset(const EpisodeContext& context) override {
    faults_ = {};
    held_ = {context.start.X_WB, context.start.q};
    network_->reset();
    values_.reset(context, language_ == nullptr ? std::vector<float>{} : language_->embed(context.prompt));
  }

  // Where there is no plan: the pose of the last one, at first that of the start.
  Anchors act(const Observation& observation) override {
    const std::vector<Reference> references = plan(observation);
    return anchors_of(references.empty() ? std::vector{held_} : references);
  }

  std::vector<Reference> plan(const Observation& observation) override {
    if (!is_finite(observation))
      return faults_.leave_out(name_, observation.tick, "observation: expected finite numbers, found others");
    for (std::size_t i = 0; i < inputs_.size(); ++i) write(inputs_[i], observation, buffers_[i]);
    network_->run(network_inputs_, network_outputs_);
    DecodedPlan decoded = decoder_.decode(network_outputs_[plan_output_], observation.now().robot);
    if (!decoded.fault.empty()) return faults_.leave_out(name_, observation.tick, decoded.fault);
    held_ = decoded.references.front();
    return std::move(decoded.references);
  }

 private:
  void write(const PolicyInput& input, const Observation& observation, std::vector<float>& buffer) {
    const int newest = static_cast<int>(observation.history.size()) - 1;
    std::span<float> rest(buffer);
    for (int i = 0; i < input.frames; ++i) {
      const int frame = input.newest_first ? newest - i : newest - input.frames + 1 + i;
      for (const PolicyChannel& channel : input.channels) {
        const std::size_t size = channel_size(channel, joints_);
        values_.write(channel, observation, frame, rest.first(size));
        rest = rest.subspan(size);
      }
    }
  }

  void bind_inputs(const PolicyDescriptor& descriptor, const std::string& network_path) {
    const std::span<const Port> ports = network_->inputs();
    network_inputs_.resize(ports.size());
    buffers_.resize(inputs_.size());
    for (std::size_t i = 0; i < inputs_.size(); ++i) {
      const PolicyInput& input = inputs_[i];
      const std::string place = fmt::format("{}:{}: with {}", descriptor.file, input.line, network_path);
      const std::size_t port = find_port(ports, input.name, "input", place);
      const int size = input.frames * frame_size(input, joints_);
      if (size != ports[port].size)
        throw InputError(fmt::format("{}: input '{}': expected {} numbers, found {} of the channels: {}", place,
                                     ports[port].name, ports[port].size, size, layout(input, joints_)));
      if (network_inputs_[port].data() != nullptr)
        throw InputError(fmt::format("{}: expected each input once, found '{}' again", place, ports[port].name));
      buffers_[i].resize(size);
      network_inputs_[port] = buffers_[i];
    }
    for (std::size_t port = 0; port < ports.size(); ++port)
      if (network_inputs_[port].data() == nullptr)
        throw InputError(
            fmt::format("{}: with {}: expected every input of the network in 'inputs', found none for '{}'",
                        descriptor.file, network_path, ports[port].name));
  }

  void bind_outputs(const PolicyDescriptor& descriptor, const std::string& network_path) {
    const std::span<const Port> ports = network_->outputs();
    const std::string place = fmt::format("{}:{}: with {}", descriptor.file, descriptor.output.line, network_path);
    plan_output_ = find_port(ports, descriptor.output.name, "output", place);
    if (ports[plan_output_].size != decoder_.size())
      throw InputError(fmt::format("{}: output '{}': expected {} numbers ({} anchors of {}), found {}", place,
                                   ports[plan_output_].name, decoder_.size(), descriptor.output.anchors,
                                   decoder_.anchor_size(), ports[plan_output_].size));
    results_.reserve(ports.size());
    for (const Port& port : ports) results_.emplace_back(port.size);
    network_outputs_.assign(results_.begin(), results_.end());
  }

  std::string name_;
  std::unique_ptr<Network> network_;
  std::shared_ptr<const LanguageEncoder> language_;  // shared between episodes; null where no channel shows it
  std::vector<PolicyInput> inputs_;
  int joints_;
  ChannelValues values_;
  PlanDecoder decoder_;
  std::vector<std::vector<float>> buffers_, results_;   // of inputs_; of the network's outputs
  std::vector<std::span<const float>> network_inputs_;  // in the network's order
  std::vector<std::span<float>> network_outputs_;
  std::size_t plan_output_ = 0;
  Reference held_;
  PolicyFaults faults_;
};

}  // namespace

bool shows_language(const PolicyDescriptor& descriptor) {
  for (const PolicyInput& input : descriptor.inputs)
    for (const PolicyChannel& channel : input.channels)
      if (channel.kind == PolicyChannelKind::kLanguage) return true;
  return false;
}

std::unique_ptr<Policy> make_onnx_policy(const PolicyDescriptor& descriptor,
                                         const std::shared_ptr<const RobotModel>& robot,
                                         std::unique_ptr<Network> network, const std::string& network_path,
                                         std::shared_ptr<const LanguageEncoder> language) {
  require(robot != nullptr && network != nullptr,
          fmt::format("policy '{}': expected a robot and a network, found none", descriptor.name));
  require(!shows_language(descriptor) || (language != nullptr && language->size() == kLanguageSize),
          fmt::format("policy '{}': expected a language encoder of {} numbers, found none", descriptor.name,
                      kLanguageSize));
  return std::make_unique<OnnxPolicy>(descriptor, robot, std::move(network), network_path, std::move(language));
}

}  // namespace duet
