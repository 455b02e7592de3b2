// The layers that D-STAR is made of, in float, over columns: a column is a frame, a token or a position, and columns
// follow one another without gaps. NaN stays NaN. Nothing here allocates but in constructors. Private to
// policies/dstar/.
#pragma once

#include <span>
#include <string>

#include "duet/policies/dstar/network.h"

namespace duet {

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

}  // namespace duet
