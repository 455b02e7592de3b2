// From frames to the context that the denoiser is conditioned on: streams of the long-short temporal encoder, phase
// attention and multi-scale spatial reasoning (A.2.1 to A.2.3). Each borrows its network's weights, owns its buffers
// and allocates at construction only. Private to policies/dstar/.
#pragma once

#include <array>
#include <string>
#include <vector>

#include "duet/policies/dstar/layers.h"

namespace duet {

// A pre-norm transformer over a stream's frames, the newest frame's token read out.
class StreamEncoder {
 public:
  // `name`: "long" or "short".
  StreamEncoder(const DstarNetwork& network, const std::string& name, int frames);
  // `frames`: kHistoryFrames normalised frames, oldest first, of which the last ones count. out: config.stream.
  void encode(const float* frames, float* out);

 private:
  struct Layer {
    Norm norm1, norm2;
    Linear qkv, out, up, down;
  };
  void run(const Layer& layer);

  int frames_, width_, heads_;
  Linear in_, head_;
  const float* position_;
  std::vector<Layer> layers_;
  Norm norm_;
  std::vector<float> tokens_, normed_, qkv_, hidden_, scores_;
};

// Experts of three phases, weighted by the phases' probabilities.
class PhaseAttention {
 public:
  explicit PhaseAttention(const DstarNetwork& network);
  // out: config.phase.
  void run(const float* temporal, float* out);
  [[nodiscard]] std::span<const float> phases() const { return phases_; }

 private:
  int temporal_, tokens_;
  Linear classify1_, classify2_, out_;
  std::array<Linear, kPhases> experts_;
  std::array<float, kPhases> phases_{};
  std::vector<float> hidden_, qkv_, expert_, mixture_, scores_;
};

// Position, distance by zone and orientation -> the interaction field, fused with the temporal feature.
class SpatialReasoning {
 public:
  explicit SpatialReasoning(const DstarNetwork& network);
  // out: config.spatial.
  void run(const DstarFeatures& features, const float* temporal, float* out);

 private:
  struct Zone {
    Linear first, second;
  };
  void encode(const DstarFeatures& features);

  int field_, heads_;
  std::array<Zone, kZones> zones_;
  Linear orientation_, field1_, field2_, temporal_, qkv_, fusion_out_, out_;
  std::vector<float> hidden_, spatial_, field_hidden_, tokens_, qkv_values_, attended_, fused_, scores_;
};

// 0, 1 or 2 for near, mid and far [m].
int zone_of(float distance);

}  // namespace duet
