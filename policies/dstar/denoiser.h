// The diffusion head: one-dimensional convolutions of 3 over the anchors with group norm, scaled and shifted by the
// condition and the step (FiLM), predicting x_0; and DDIM through it. Private to policies/dstar/.
#pragma once

#include <span>
#include <vector>

#include "duet/policies/dstar/encoder.h"

namespace duet {

// Owns its buffers, borrows the network's weights; allocates at construction only.
class Denoiser {
 public:
  explicit Denoiser(const DstarNetwork& network);
  Denoiser(const Denoiser&) = delete;  // its layers point into it
  Denoiser& operator=(const Denoiser&) = delete;
  // `condition`: g, config.condition numbers; holds for the samples after it.
  void condition(const float* condition);
  // The plan in normalised units, kPlanSize numbers, from x_T. Valid until the next call.
  std::span<const float> sample(std::span<const float> noise);

 private:
  struct Block {
    Norm norm1, norm2;
    std::vector<float> taps1, taps2;  // weights by output, tap, input: columns of x side by side are one input
    Linear conv1, conv2, film_condition;
    std::vector<float> film;        // scale and shift by the condition, for the sample at hand
    std::vector<float> film_steps;  // by each step of inference
  };
  void add_steps(const DstarConfig& config);
  // x0 <- network(x, step).
  void denoise(const float* x, int step);
  void run(const Block& block, int step);
  // y <- conv(silu(y)).
  void convolve(const Linear& conv);
  void modulate(const Block& block, int step);

  // x <- x0_share x0 + noise_share (x - seen_share x0) / noise_part, of one step.
  struct Step {
    float seen_share, noise_part, x0_share, noise_share;
  };

  int channels_, groups_;
  Linear in_, out_;
  const float* position_;
  std::vector<Block> blocks_;
  Norm norm_;
  std::vector<Step> steps_;
  std::vector<float> x_, x0_, h_, y_, padded_;
};

}  // namespace duet
