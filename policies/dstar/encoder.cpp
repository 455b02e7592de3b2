#include "duet/policies/dstar/encoder.h"

#include <fmt/format.h>

#include <algorithm>

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

}  // namespace duet
