#include "duet/policies/dstar/encoder.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "duet/nn/dense_kernels.h"

namespace duet {
namespace {

std::size_t size_of(int a, int b) { return static_cast<std::size_t>(a) * static_cast<std::size_t>(b); }

}  // namespace

StreamEncoder::StreamEncoder(const DstarNetwork& network, const std::string& name, int frames)
    : frames_(frames), width_(network.config.width), heads_(network.config.heads) {
  const WeightsOf weights(network);
  in_ = weights.linear(name + ".in");
  head_ = weights.linear(name + ".head");
  position_ = weights.values(name + ".position");
  norm_ = weights.norm(name + ".norm");
  layers_.reserve(static_cast<std::size_t>(network.config.layers));
  for (int l = 0; l < network.config.layers; ++l) {
    const std::string layer = fmt::format("{}.{}", name, l);
    layers_.push_back({.norm1 = weights.norm(layer + ".norm1"),
                       .norm2 = weights.norm(layer + ".norm2"),
                       .qkv = weights.linear(layer + ".qkv"),
                       .out = weights.linear(layer + ".out"),
                       .up = weights.linear(layer + ".up"),
                       .down = weights.linear(layer + ".down")});
  }
  tokens_.resize(size_of(frames, width_));
  normed_.resize(tokens_.size());
  qkv_.resize(3 * tokens_.size());
  hidden_.resize(size_of(frames, network.config.feedforward));
  scores_.resize(static_cast<std::size_t>(frames));
}

void StreamEncoder::encode(const float* frames, float* out) {
  in_.apply(frames + (kHistoryFrames - frames_) * kFrameSize, tokens_.data(), frames_);
  add(tokens_, position_);
  for (const Layer& layer : layers_) run(layer);
  const float* newest = tokens_.data() + tokens_.size() - width_;
  norm_.by_column(newest, normed_.data());
  head_.apply(normed_.data(), out);
}

void StreamEncoder::run(const Layer& layer) {
  layer.norm1.by_column(tokens_.data(), normed_.data(), frames_);
  layer.qkv.apply(normed_.data(), qkv_.data(), frames_);
  attend_by_heads(qkv_.data(), frames_, width_, heads_, normed_.data(), scores_);
  layer.out.apply(normed_.data(), qkv_.data(), frames_);
  add(tokens_, qkv_.data());
  layer.norm2.by_column(tokens_.data(), normed_.data(), frames_);
  layer.up.apply(normed_.data(), hidden_.data(), frames_);
  gelu(hidden_);
  layer.down.apply(hidden_.data(), normed_.data(), frames_);
  add(tokens_, normed_.data());
}

PhaseAttention::PhaseAttention(const DstarNetwork& network)
    : temporal_(network.config.temporal), tokens_(network.config.tokens) {
  const WeightsOf weights(network);
  classify1_ = weights.linear("phase.classify1");
  classify2_ = weights.linear("phase.classify2");
  out_ = weights.linear("phase.out");
  for (int i = 0; i < kPhases; ++i) experts_[i] = weights.linear(fmt::format("phase.expert.{}", i));
  hidden_.resize(static_cast<std::size_t>(classify1_.outputs));
  qkv_.resize(size_of(3, temporal_));
  expert_.resize(static_cast<std::size_t>(temporal_));
  mixture_.resize(expert_.size());
  scores_.resize(static_cast<std::size_t>(tokens_));
}

void PhaseAttention::run(const float* temporal, float* out) {
  classify1_.apply(temporal, hidden_.data());
  silu(hidden_);
  classify2_.apply(hidden_.data(), phases_.data());
  softmax(phases_);
  std::ranges::fill(mixture_, 0.0F);
  const int size = temporal_ / tokens_;
  for (int i = 0; i < kPhases; ++i) {
    experts_[i].apply(temporal, qkv_.data());
    attend({.q = qkv_.data(),
            .k = qkv_.data() + temporal_,
            .v = qkv_.data() + 2 * temporal_,
            .step = size,
            .tokens = tokens_,
            .size = size,
            .out = expert_.data(),
            .out_step = size},
           scores_);
    for (std::size_t k = 0; k < mixture_.size(); ++k) mixture_[k] += phases_[i] * expert_[k];
  }
  out_.apply(mixture_.data(), out);
}

SpatialReasoning::SpatialReasoning(const DstarNetwork& network)
    : field_(network.config.field), heads_(network.config.fusion_heads) {
  const WeightsOf weights(network);
  for (int z = 0; z < kZones; ++z)
    zones_[z] = {.first = weights.linear(fmt::format("spatial.zone.{}.1", z)),
                 .second = weights.linear(fmt::format("spatial.zone.{}.2", z))};
  orientation_ = weights.linear("spatial.orientation");
  field1_ = weights.linear("spatial.field1");
  field2_ = weights.linear("spatial.field2");
  temporal_ = weights.linear("spatial.temporal");
  qkv_ = weights.linear("spatial.fusion.qkv");
  fusion_out_ = weights.linear("spatial.fusion.out");
  out_ = weights.linear("spatial.out");
  hidden_.resize(static_cast<std::size_t>(network.config.zone));
  spatial_.resize(static_cast<std::size_t>(field1_.inputs));
  field_hidden_.resize(static_cast<std::size_t>(field1_.outputs));
  tokens_.resize(size_of(2, field_));
  qkv_values_.resize(3 * tokens_.size());
  attended_.resize(tokens_.size());
  fused_.resize(tokens_.size());
  scores_.resize(2);
}

void SpatialReasoning::run(const DstarFeatures& features, const float* temporal, float* out) {
  encode(features);
  field1_.apply(spatial_.data(), field_hidden_.data());
  silu(field_hidden_);
  field2_.apply(field_hidden_.data(), tokens_.data());
  temporal_.apply(temporal, tokens_.data() + field_);
  qkv_.apply(tokens_.data(), qkv_values_.data(), 2);
  attend_by_heads(qkv_values_.data(), 2, field_, heads_, attended_.data(), scores_);
  fusion_out_.apply(attended_.data(), fused_.data(), 2);
  add(tokens_, fused_.data());
  out_.apply(tokens_.data(), out);
}

void SpatialReasoning::encode(const DstarFeatures& features) {
  float* out = std::copy_n(features.position.data(), kPositionSize, spatial_.data());
  for (int r = 0; r < kRelations; ++r) {
    const float distance = features.distance[r];
    const Zone& zone = zones_[zone_of(distance)];
    zone.first.apply(&distance, hidden_.data());
    silu(hidden_);
    zone.second.apply(hidden_.data(), out);
    out += zone.second.outputs;
  }
  orientation_.apply(features.orientation.data(), out);
  silu({out, static_cast<std::size_t>(orientation_.outputs)});
}

int zone_of(float distance) {
  if (distance < 0.3F) return 0;
  return distance < 0.8F ? 1 : 2;
}

namespace {

constexpr float kEpsilon = 1e-5F;  // of the normalisations

struct Moments {
  float mean, inverse_deviation;
};

// The sum of `f` over `rows` numbers in each of `columns` columns that begin `step` apart. Four sums side by side: one
// after the other would wait for each addition.
template <typename F>
float sum(const float* x, int rows, int columns, int step, const F& f) {
  float sums[4] = {};
  for (int c = 0; c < columns; ++c) {
    const float* column = x + c * step;
    int i = 0;
    for (; i + 4 <= rows; i += 4)
      for (int k = 0; k < 4; ++k) sums[k] += f(column[i + k]);
    for (; i < rows; ++i) sums[0] += f(column[i]);
  }
  return (sums[0] + sums[1]) + (sums[2] + sums[3]);
}

Moments moments(const float* x, int rows, int columns, int step) {
  const auto count = static_cast<float>(rows * columns);
  const float mean = sum(x, rows, columns, step, [](float value) { return value; }) / count;
  const float square = sum(x, rows, columns, step, [mean](float value) { return (value - mean) * (value - mean); });
  return {mean, 1.0F / std::sqrt(square / count + kEpsilon)};
}

float dot(const float* a, const float* b, int n) {
  float result = 0.0F;
  for (int i = 0; i < n; ++i) result += a[i] * b[i];
  return result;
}

}  // namespace

void Linear::apply(const float* x, int step, float* y, int columns) const {
  // A few rows for all columns, then the next ones: they stay in the nearest cache.
  constexpr int kRows = 8;
  const int at_once = columns == 1 ? outputs : kRows;
  const auto gemv = dense_kernels().gemv;
  for (int row = 0; row < outputs; row += at_once)
    for (int c = 0; c < columns; ++c)
      gemv(std::min(at_once, outputs - row), inputs, weight + static_cast<std::ptrdiff_t>(row) * inputs, x + c * step,
           bias == nullptr ? nullptr : bias + row, y + c * outputs + row);
}

void Norm::by_column(const float* x, float* y, int columns) const {
  for (int c = 0; c < columns; ++c, x += channels, y += channels) {
    const Moments m = moments(x, channels, 1, channels);
    for (int i = 0; i < channels; ++i) y[i] = (x[i] - m.mean) * m.inverse_deviation * weight[i] + bias[i];
  }
}

void Norm::by_group(const float* x, float* y, int groups, int columns) const {
  const int size = channels / groups;
  for (int first = 0; first < channels; first += size) {
    const Moments m = moments(x + first, size, columns, channels);
    for (int c = 0; c < columns; ++c)
      for (int i = first; i < first + size; ++i)
        y[c * channels + i] = (x[c * channels + i] - m.mean) * m.inverse_deviation * weight[i] + bias[i];
  }
}

void silu(std::span<float> x) {
  for (float& value : x) value /= 1.0F + std::exp(-value);
}

void gelu(std::span<float> x) {
  constexpr auto kScale = static_cast<float>(1.0 / std::numbers::sqrt2);
  for (float& value : x) value *= 0.5F * (1.0F + std::erf(value * kScale));
}

void softmax(std::span<float> x) {
  const float largest = *std::ranges::max_element(x);
  float total = 0.0F;
  for (float& value : x) total += value = std::exp(value - largest);
  for (float& value : x) value /= total;
}

void add(std::span<float> x, const float* y) {
  for (std::size_t i = 0; i < x.size(); ++i) x[i] += y[i];
}

void clip(std::span<float> x, float bound) {
  for (float& value : x) value = value > bound ? bound : (value < -bound ? -bound : value);
}

void attend(const Attention& a, std::span<float> scores) {
  const float scale = 1.0F / std::sqrt(static_cast<float>(a.size));
  for (int i = 0; i < a.tokens; ++i) {
    for (int j = 0; j < a.tokens; ++j) scores[j] = scale * dot(a.q + i * a.step, a.k + j * a.step, a.size);
    softmax(scores.first(a.tokens));
    float* out = a.out + i * a.out_step;
    std::fill_n(out, a.size, 0.0F);
    for (int j = 0; j < a.tokens; ++j)
      for (int d = 0; d < a.size; ++d) out[d] += scores[j] * a.v[j * a.step + d];
  }
}

void attend_by_heads(const float* qkv, int tokens, int width, int heads, float* out, std::span<float> scores) {
  const int size = width / heads;
  for (int first = 0; first < width; first += size)
    attend({.q = qkv + first,
            .k = qkv + width + first,
            .v = qkv + 2 * width + first,
            .step = 3 * width,
            .tokens = tokens,
            .size = size,
            .out = out + first,
            .out_step = width},
           scores);
}

Linear WeightsOf::linear(const std::string& name) const {
  const Tensor& weight = weights_.at(name + ".weight");
  const auto bias = weights_.find(name + ".bias");
  return {.outputs = static_cast<int>(weight.shape[0]),
          .inputs = static_cast<int>(weight.shape[1]),
          .weight = weight.values.data(),
          .bias = bias == weights_.end() ? nullptr : bias->second.values.data()};
}

Norm WeightsOf::norm(const std::string& name) const {
  const Tensor& weight = weights_.at(name + ".weight");
  return {
      .channels = static_cast<int>(weight.shape[0]), .weight = weight.values.data(), .bias = values(name + ".bias")};
}

}  // namespace duet
