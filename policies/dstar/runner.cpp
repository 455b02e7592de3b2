
#include <optional>
#include <utility>

#include "duet/core/require.h"
#include "duet/policies/dstar/denoiser.h"
#include "duet/policies/dstar/encoder.h"
#include "duet/policies/dstar/network.h"
#include "duet/policies/dstar/tensors.h"

namespace duet {
namespace {

constexpr float kFrameClip = 10.0F;  // of a normalised channel

std::shared_ptr<const DstarNetwork> checked(std::shared_ptr<const DstarNetwork> network) {
  require(network != nullptr, "D-STAR: a runner needs a network");
  const std::string problem = network_problem(*network);
  require(problem.empty(), "network of D-STAR: {}", problem);
  return network;
}

}  // namespace

struct DstarRunner::Work {
  explicit Work(std::shared_ptr<const DstarNetwork> given);
  void encode(const DstarInput& input);
  void normalise(const DstarFrames& in, DstarFrames& out) const;
  void denormalise();

  std::shared_ptr<const DstarNetwork> network;  // shared: many episodes run one
  StreamEncoder long_stream;
  std::optional<StreamEncoder> short_stream;
  std::optional<PhaseAttention> phase;
  std::optional<SpatialReasoning> spatial;
  Linear temporal, condition1, condition2;
  Denoiser denoiser;
  std::vector<float> streams, context, hidden, condition, plan;
  DstarFrames frames, past;
  std::span<const float> normalised;
};

DstarRunner::Work::Work(std::shared_ptr<const DstarNetwork> given)
    : network(checked(std::move(given))),
      long_stream(*network, "long", network->config.long_frames),
      denoiser(*network),
      plan(kPlanSize) {
  const DstarConfig& config = network->config;
  const WeightsOf weights(*network);
  if (config.short_stream) short_stream.emplace(*network, "short", config.short_frames);
  if (config.phase_attention) phase.emplace(*network);
  if (config.spatial_reasoning) spatial.emplace(*network);
  temporal = weights.linear("temporal");
  condition1 = weights.linear("condition.1");
  condition2 = weights.linear("condition.2");
  streams.resize(static_cast<std::size_t>(temporal.inputs));
  context.resize(static_cast<std::size_t>(condition1.inputs));
  hidden.resize(static_cast<std::size_t>(config.condition));
  condition.resize(hidden.size());
}

void DstarRunner::Work::normalise(const DstarFrames& in, DstarFrames& out) const {
  out = (in.colwise() - network->frame_mean).array().colwise() / network->frame_deviation.array();
  clip({out.data(), static_cast<std::size_t>(out.size())}, kFrameClip);
}

// The condition g of an input.
void DstarRunner::Work::encode(const DstarInput& input) {
  const DstarConfig& config = network->config;
  normalise(input.features->frames, frames);
  normalise(input.features->past, past);
  long_stream.encode(past.data(), streams.data());
  if (short_stream) short_stream->encode(frames.data(), streams.data() + config.stream);
  const float* f_temp = context.data();
  float* next = context.data() + config.temporal;
  temporal.apply(streams.data(), context.data());
  if (phase) phase->run(f_temp, next), next += config.phase;
  if (spatial) spatial->run(*input.features, f_temp, next), next += config.spatial;
  if (config.language_on) std::ranges::copy(input.language, next);
  condition1.apply(context.data(), hidden.data());
  silu(hidden);
  condition2.apply(hidden.data(), condition.data());
}

void DstarRunner::Work::denormalise() {
  for (int i = 0; i < kPlanSize; ++i)
    plan[static_cast<std::size_t>(i)] =
        network->plan_mean[i] + network->plan_deviation[i] * normalised[static_cast<std::size_t>(i)];
}

DstarRunner::DstarRunner(std::shared_ptr<const DstarNetwork> network)
    : work_(std::make_unique<Work>(std::move(network))) {}

DstarRunner::~DstarRunner() = default;

std::span<const float> DstarRunner::run(const DstarInput& input) {
  const DstarConfig& config = work_->network->config;
  require(input.features != nullptr, "D-STAR: expected features, found none");
  require(input.noise.size() == kPlanSize, "D-STAR: expected 180 numbers of noise");
  require(!config.language_on || input.language.size() == static_cast<std::size_t>(config.language),
          "D-STAR: the language embedding has another size than the network's");
  work_->encode(input);
  work_->denoiser.condition(work_->condition.data());
  work_->normalised = work_->denoiser.sample(input.noise);
  work_->denormalise();
  return work_->plan;
}

std::span<const float> DstarRunner::phases() const {
  return work_->phase ? work_->phase->phases() : std::span<const float>{};
}

std::span<const float> DstarRunner::normalised_plan() const { return work_->normalised; }

}  // namespace duet
