#include "duet/policies/dstar/denoiser.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

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

}  // namespace duet
