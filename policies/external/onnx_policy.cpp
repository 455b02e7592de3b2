#include "duet/policies/external/onnx_policy.h"

#include <fmt/format.h>

#include "duet/core/require.h"
#include "duet/io/bound_network.h"
#include "duet/policies/external/channel_values.h"
#include "duet/policies/external/plan_decoder.h"

namespace duet {
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
