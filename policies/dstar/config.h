// The shape of a D-STAR network (supplement A.2) as data: what a file says of itself and what a trainer is asked for.
// The paper's dimensions are the defaults where it states them; depth, heads and widths, which it does not, are those
// of the network that ships. docs/deviations.md says why.
#pragma once

#include <string>

#include "duet/policies/policy.h"

namespace duet {

struct DstarConfig {
  // Long-short temporal encoder: each stream a pre-norm transformer over its frames, the newest frame's token read out.
  int long_frames = kHistoryFrames, short_frames = 6;
  int long_stride = 20;  // ticks between the long stream's frames: 4.4 s; printed: 1, which are 0.22 s
  int width = 128, heads = 4, feedforward = 256, layers = 2;
  int stream = 768;    // what each stream gives
  int temporal = 256;  // f_temp
  // Phase attention: f_temp as `tokens` tokens in each of the three experts.
  int tokens = 8, phase_hidden = 64;
  int phase = 256;  // f_phase
  // Multi-scale spatial reasoning.
  int zone = 16, orientation = 32;  // outputs of the distance and orientation encoders
  int field = 128, field_hidden = 256, fusion_heads = 4;
  int spatial = 128;   // f_MSS
  int language = 768;  // with f_temp, f_phase and f_MSS: the condition, 1408
  // Diffusion head: 1-D convolutions of 3 over the anchors, group norm, FiLM by the condition and by the step.
  int condition = 256;  // the 1408 projected
  int channels = 168, blocks = 4, groups = 8, step_embedding = 64;
  int training_steps = 50, inference_steps = 10;  // F: DDIM, squared-cosine
  // Ablations; what is off is neither computed nor in the file, and the condition is shorter by it.
  bool phase_attention = true, spatial_reasoning = true, short_stream = true, language_on = true;

  [[nodiscard]] int condition_inputs() const {
    return temporal + (phase_attention ? phase : 0) + (spatial_reasoning ? spatial : 0) + (language_on ? language : 0);
  }
  bool operator==(const DstarConfig&) const = default;
};

inline constexpr int kPhases = 3;
inline constexpr int kZones = 3;                          // 0-0.3, 0.3-0.8, 0.8 m and more
inline constexpr int kAnchorSize = 36;                    // root 3, quaternion wxyz 4, joints 29
inline constexpr int kPlanSize = kAnchors * kAnchorSize;  // row-major (anchor, value)

// JSON text with every field, in a fixed order; and back. Throws InputError naming `file`, the field, expected, found:
// an unknown or missing field, a value out of range, sizes that do not divide (width by heads, temporal by tokens,
// field by fusion_heads, channels by groups).
std::string to_json_text(const DstarConfig& config);
DstarConfig parse_dstar_config(const std::string& text, const std::string& file);
// The first of those that is wrong with a configuration made otherwise; "" where nothing is.
std::string config_problem(const DstarConfig& config);

}  // namespace duet
