// Functions of time from which the synthesis is put together. All of them are twice continuously differentiable, so
// nothing that is made of them jumps in velocity. Values, no shared state.
#pragma once

#include <array>
#include <vector>

#include "duet/core/numbers.h"

namespace duet::synthesis {

// 0 -> 1 over u in [0, 1] with the least jerk (10 u^3 - 15 u^4 + 6 u^5); constant outside. Peak rate 1.875.
double ramp(double u);
// 0 -> 1 like ramp, but with a flatter middle (rate proportional to (1 - x^4)^2): peak rate only kGlidePeak.
double glide(double u);
inline constexpr double kGlidePeak = 45.0 / 32.0;
// 0 -> 1 -> 0 over u in [0, 1]; 0 outside.
double pulse(double u);

// A scalar that goes from value to value with ramps and rests in between.
class Channel {
 public:
  explicit Channel(double rest = 0.0) : rest_(rest) {}
  // Moves to `value` over [begin, end] [s]. Throws std::invalid_argument where it would begin before the last move
  // ended.
  void to(double begin, double end, double value);
  [[nodiscard]] double at(double t) const;

 private:
  struct Move {
    double begin, end, from, to;
  };
  double rest_;
  std::vector<Move> moves_;
};

// Slow, aperiodic-looking swaying within [-1, 1]: three incommensurate sines below 0.5 Hz.
class Sway {
 public:
  Sway() = default;
  explicit Sway(Random random);
  [[nodiscard]] double at(double t) const;

 private:
  struct Wave {
    double rate = 0.0, phase = 0.0;  // [rad/s], [rad]
  };
  std::array<Wave, 3> waves_;
};

// A sine of `rate_hz` that swells at `begin` and dies away before `end`, within [-1, 1]. [s]
struct Burst {
  double begin = 0.0;
  double end = 0.0;
  double rate_hz = 1.0;
  double swell = 0.3;  // length of either ramp [s]
  [[nodiscard]] double at(double t) const;
};

}  // namespace duet::synthesis
