#include "duet/policies/dstar/denoiser.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <optional>
#include <utility>

#include "duet/core/require.h"
#include "duet/policies/dstar/encoder.h"
#include "duet/policies/dstar/network.h"

namespace duet {
namespace {

constexpr float kPlanClip = 5.0F;  // of x_0, in normalised units
constexpr int kTaps = 3;

// Weights (output, input, tap) -> (output, tap, input).
std::vector<float> taps_first(const float* weight, int channels) {
  std::vector<float> taps(static_cast<std::size_t>(channels) * channels * kTaps);
  auto to = taps.begin();
  for (int output = 0; output < channels; ++output)
    for (int tap = 0; tap < kTaps; ++tap)
      for (int input = 0; input < channels; ++input)
        *to++ = weight[(static_cast<std::ptrdiff_t>(output) * channels + input) * kTaps + tap];
  return taps;
}

std::vector<float> embed_step(int step, int size) {
  std::vector<float> embedding(static_cast<std::size_t>(size));
  const int half = size / 2;
  for (int i = 0; i < half; ++i) {
    const double angle = step * std::exp(-std::log(10000.0) * i / half);
    embedding[static_cast<std::size_t>(i)] = static_cast<float>(std::sin(angle));
    embedding[static_cast<std::size_t>(half + i)] = static_cast<float>(std::cos(angle));
  }
  return embedding;
}

// e_t of each step of inference.
std::vector<std::vector<float>> encode_steps(const DstarNetwork& network) {
  const WeightsOf weights(network);
  const Linear first = weights.linear("step.1"), second = weights.linear("step.2");
  const DstarConfig& config = network.config;
  std::vector<std::vector<float>> encoded;
  std::vector<float> hidden(static_cast<std::size_t>(config.condition)), out(hidden.size());
  for (const int step : ddim_steps(config.training_steps, config.inference_steps)) {
    first.apply(embed_step(step, config.step_embedding).data(), hidden.data());
    silu(hidden);
    second.apply(hidden.data(), out.data());
    encoded.push_back(out);
  }
  return encoded;
}

std::vector<float> film_of_steps(const Linear& film, const std::vector<std::vector<float>>& steps) {
  std::vector<float> values(steps.size() * static_cast<std::size_t>(film.outputs));
  for (std::size_t i = 0; i < steps.size(); ++i)
    film.apply(steps[i].data(), values.data() + i * static_cast<std::size_t>(film.outputs));
  return values;
}

}  // namespace

Denoiser::Denoiser(const DstarNetwork& network) : channels_(network.config.channels), groups_(network.config.groups) {
  const WeightsOf weights(network);
  const DstarConfig& config = network.config;
  in_ = weights.linear("denoise.in");
  out_ = weights.linear("denoise.out");
  position_ = weights.values("denoise.position");
  norm_ = weights.norm("denoise.norm");
  const std::vector<std::vector<float>> steps = encode_steps(network);
  blocks_.reserve(static_cast<std::size_t>(config.blocks));
  for (int b = 0; b < config.blocks; ++b) {
    const std::string name = fmt::format("denoise.{}", b);
    Block block{.norm1 = weights.norm(name + ".norm1"),
                .norm2 = weights.norm(name + ".norm2"),
                .taps1 = taps_first(weights.values(name + ".conv1.weight"), channels_),
                .taps2 = taps_first(weights.values(name + ".conv2.weight"), channels_),
                .conv1 = {},
                .conv2 = {},
                .film_condition = weights.linear(name + ".film_condition"),
                .film = std::vector<float>(static_cast<std::size_t>(2 * channels_)),
                .film_steps = film_of_steps(weights.linear(name + ".film_step"), steps)};
    block.conv1 = {channels_, kTaps * channels_, block.taps1.data(), weights.values(name + ".conv1.bias")};
    block.conv2 = {channels_, kTaps * channels_, block.taps2.data(), weights.values(name + ".conv2.bias")};
    blocks_.push_back(std::move(block));
  }
  add_steps(config);
  x_.resize(kPlanSize);
  x0_.resize(kPlanSize);
  h_.resize(static_cast<std::size_t>(kAnchors) * channels_);
  y_.resize(h_.size());
  padded_.resize(h_.size() + 2 * static_cast<std::size_t>(channels_));
}

void Denoiser::add_steps(const DstarConfig& config) {
  const std::vector<double> alpha_bar = squared_cosine_alpha_bar(config.training_steps);
  const std::vector<int> times = ddim_steps(config.training_steps, config.inference_steps);
  steps_.reserve(times.size());
  for (std::size_t i = 0; i < times.size(); ++i) {
    const double now = alpha_bar[static_cast<std::size_t>(times[i])];
    const double next = i + 1 < times.size() ? alpha_bar[static_cast<std::size_t>(times[i + 1])] : 1.0;
    steps_.push_back({.seen_share = static_cast<float>(std::sqrt(now)),
                      .noise_part = static_cast<float>(std::sqrt(1.0 - now)),
                      .x0_share = static_cast<float>(std::sqrt(next)),
                      .noise_share = static_cast<float>(std::sqrt(1.0 - next))});
  }
}

void Denoiser::condition(const float* condition) {
  for (Block& block : blocks_) block.film_condition.apply(condition, block.film.data());
}

std::span<const float> Denoiser::sample(std::span<const float> noise) {
  std::ranges::copy(noise, x_.begin());
  for (std::size_t i = 0; i < steps_.size(); ++i) {
    denoise(x_.data(), static_cast<int>(i));
    clip(x0_, kPlanClip);
    const Step& step = steps_[i];
    for (std::size_t k = 0; k < x_.size(); ++k)
      x_[k] = step.x0_share * x0_[k] + step.noise_share * ((x_[k] - step.seen_share * x0_[k]) / step.noise_part);
  }
  return x0_;
}

void Denoiser::denoise(const float* x, int step) {
  in_.apply(x, h_.data(), kAnchors);
  add(h_, position_);
  for (const Block& block : blocks_) run(block, step);
  norm_.by_group(h_.data(), y_.data(), groups_, kAnchors);
  silu(y_);
  out_.apply(y_.data(), x0_.data(), kAnchors);
}

void Denoiser::run(const Block& block, int step) {
  block.norm1.by_group(h_.data(), y_.data(), groups_, kAnchors);
  convolve(block.conv1);
  block.norm2.by_group(y_.data(), y_.data(), groups_, kAnchors);
  modulate(block, step);
  convolve(block.conv2);
  add(h_, y_.data());
}

// A column and its two neighbours lie side by side: one input of three times the channels. Before the first and after
// the last column there are zeros, which nothing ever writes to.
void Denoiser::convolve(const Linear& conv) {
  silu(y_);
  std::ranges::copy(y_, padded_.begin() + channels_);
  conv.apply(padded_.data(), channels_, y_.data(), kAnchors);
}

void Denoiser::modulate(const Block& block, int step) {
  const float* by_step = block.film_steps.data() + static_cast<std::ptrdiff_t>(step) * 2 * channels_;
  for (int i = 0; i < channels_; ++i) {
    const float scale = block.film[i] + by_step[i];
    const float shift = block.film[channels_ + i] + by_step[channels_ + i];
    for (int c = 0; c < kAnchors; ++c) y_[c * channels_ + i] = y_[c * channels_ + i] * (1.0F + scale) + shift;
  }
}

namespace {

// Nichol and Dhariwal, "Improved denoising diffusion probabilistic models", eq. 17; x in [0, 1].
double squared_cosine(double x) {
  constexpr double kOffset = 0.008;
  const double cosine = std::cos((x + kOffset) / (1.0 + kOffset) * std::numbers::pi / 2.0);
  return cosine * cosine;
}

}  // namespace

std::vector<double> squared_cosine_alpha_bar(int steps) {
  constexpr double kLargestBeta = 0.999;
  require(steps > 0, "squared_cosine_alpha_bar: expected at least one step");
  std::vector<double> alpha_bar(static_cast<std::size_t>(steps));
  double product = 1.0;
  for (int t = 0; t < steps; ++t) {
    const double left = squared_cosine((t + 1.0) / steps) / squared_cosine(static_cast<double>(t) / steps);
    product *= 1.0 - std::min(1.0 - left, kLargestBeta);
    alpha_bar[static_cast<std::size_t>(t)] = product;
  }
  return alpha_bar;
}

std::vector<int> ddim_steps(int training_steps, int inference_steps) {
  require(inference_steps > 0 && inference_steps <= training_steps,
          "ddim_steps: expected from one step of inference to as many as of training");
  std::vector<int> steps(static_cast<std::size_t>(inference_steps));
  for (int i = 0; i < inference_steps; ++i) {
    const double share = inference_steps > 1 ? static_cast<double>(i) / (inference_steps - 1) : 0.0;
    steps[static_cast<std::size_t>(i)] = static_cast<int>(std::lround((training_steps - 1) * (1.0 - share)));
  }
  return steps;
}

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
