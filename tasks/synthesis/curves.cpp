#include "duet/tasks/synthesis/curves.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "duet/core/require.h"

namespace duet::synthesis {
namespace {

constexpr double kTwoPi = 2.0 * std::numbers::pi;

}  // namespace

double ramp(double u) {
  const double x = std::clamp(u, 0.0, 1.0);
  return x * x * x * (10.0 + x * (6.0 * x - 15.0));
}

double glide(double u) {
  // Rounding would leave 1e-17 at the ends; a planted foot is to stand exactly still.
  if (u <= 0.0) return 0.0;
  if (u >= 1.0) return 1.0;
  const double x = 2.0 * u - 1.0;
  const double x4 = x * x * x * x;
  return 0.5 + 0.5 * kGlidePeak * x * (1.0 - 0.4 * x4 + x4 * x4 / 9.0);
}

double pulse(double u) {
  const double s = ramp(u);
  return 4.0 * s * (1.0 - s);
}

void Channel::to(double begin, double end, double value) {
  require(end > begin && (moves_.empty() || begin >= moves_.back().end - 1e-9),
          "synthesis channel: a move overlaps the one before it");
  moves_.push_back({begin, end, moves_.empty() ? rest_ : moves_.back().to, value});
}

double Channel::at(double t) const {
  double value = rest_;
  for (const Move& move : moves_) {
    if (t <= move.begin) break;
    value = move.from + (move.to - move.from) * ramp((t - move.begin) / (move.end - move.begin));
  }
  return value;
}

Sway::Sway(Random random) {
  const std::array<double, 3> centre_hz = {0.11, 0.19, 0.33};
  for (size_t k = 0; k < waves_.size(); ++k) {
    waves_[k].rate = kTwoPi * centre_hz[k] * random.uniform(0.85, 1.15);
    waves_[k].phase = random.uniform(0.0, kTwoPi);
  }
}

double Sway::at(double t) const {
  constexpr std::array<double, 3> kShare = {0.45, 0.35, 0.2};
  double value = 0.0;
  for (size_t k = 0; k < waves_.size(); ++k) value += kShare[k] * std::sin(waves_[k].rate * t + waves_[k].phase);
  return value;
}

double Burst::at(double t) const {
  if (t <= begin || t >= end) return 0.0;
  const double edge = std::min(swell, 0.5 * (end - begin));
  const double envelope = ramp((t - begin) / edge) * ramp((end - t) / edge);
  return envelope * std::sin(kTwoPi * rate_hz * (t - begin));
}

}  // namespace duet::synthesis
