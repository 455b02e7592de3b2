// From frames to the context that the denoiser is conditioned on: streams of the long-short temporal encoder, phase
// attention and multi-scale spatial reasoning (A.2.1 to A.2.3). Each borrows its network's weights, owns its buffers
// and allocates at construction only. Private to policies/dstar/.
#pragma once

#include <array>
#include <span>
#include <string>
#include <vector>

#include "duet/policies/dstar/network.h"

namespace duet {

// The layers that D-STAR is made of, in float, over columns: a column is a frame, a token or a position, and columns
// follow one another without gaps. NaN stays NaN. Nothing here allocates but in constructors. Private to
// policies/dstar/.

// y = W x + b of each column; borrows its weights.
struct Linear {
  int outputs = 0, inputs = 0;
  const float* weight = nullptr;  // (outputs, inputs), row-major
  const float* bias = nullptr;    // may be null

  void apply(const float* x, float* y, int columns = 1) const { apply(x, inputs, y, columns); }
  // Columns of x begin `step` numbers apart: less than `inputs` where they overlap (a convolution).
  void apply(const float* x, int step, float* y, int columns) const;
};

// Scale and offset by channel after normalisation.
struct Norm {
  int channels = 0;
  const float* weight = nullptr;
  const float* bias = nullptr;

  // Each column by itself (LayerNorm). x and y may be the same.
  void by_column(const float* x, float* y, int columns = 1) const;
  // Each group of channels over all columns (GroupNorm).
  void by_group(const float* x, float* y, int groups, int columns) const;
};

void silu(std::span<float> x);
void gelu(std::span<float> x);  // the exact one
void softmax(std::span<float> x);
void add(std::span<float> x, const float* y);
// Into [-bound, bound].
void clip(std::span<float> x, float bound);

// out = softmax(q k^T / sqrt(size)) v of one head.
struct Attention {
  const float *q, *k, *v;  // of the first token; that of the next one is `step` numbers on
  int step;
  int tokens, size;
  float* out;
  int out_step;
};
void attend(const Attention& attention, std::span<float> scores);  // scores: `tokens` numbers to work in

// All heads of tokens given as q, k, v after one another (3 width numbers a token) into out (width numbers a token).
void attend_by_heads(const float* qkv, int tokens, int width, int heads, float* out, std::span<float> scores);

// Tensors by name, of a network that was checked (network_problem).
class WeightsOf {
 public:
  explicit WeightsOf(const DstarNetwork& network) : weights_(network.weights) {}
  [[nodiscard]] const float* values(const std::string& name) const { return weights_.at(name).values.data(); }
  [[nodiscard]] Linear linear(const std::string& name) const;
  [[nodiscard]] Norm norm(const std::string& name) const;

 private:
  const std::map<std::string, Tensor>& weights_;
};

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
