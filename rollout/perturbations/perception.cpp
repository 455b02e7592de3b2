#include "duet/rollout/perturbations/perception.h"

#include <cmath>
#include <numbers>

#include "duet/core/clock.h"

namespace duet {

Perception::Perception(const PerceptionPlan& plan, std::uint64_t seed)
    : plan_(plan),
      jitter_(seed, stream_key({"perception", "jitter"})),
      dropout_(seed, stream_key({"perception", "dropout"})),
      past_(static_cast<std::size_t>(ticks_of(plan.latency_ms / 1000.0)) + 1) {
  if (!plan_.jump) return;
  const double angle = 2.0 * std::numbers::pi * Random(seed, stream_key({"perception", "jump"})).uniform();
  jump_ = plan_.jump->metres * Eigen::Vector3d(std::cos(angle), std::sin(angle), 0.0);
}

// The draws of a tick do not depend on whether the partner is seen: two plans with one seed have the same noise.
const Perception::Joints& Perception::seen(int tick, const Joints& partner) {
  if (tick == 0) std::fill(past_.begin(), past_.end(), partner);
  measure(tick, delayed(partner));
  return seen_;
}

bool Perception::held(int tick) const {
  if (tick == 0) return false;  // a first look there is
  if (plan_.vanish && tick >= ticks_of(*plan_.vanish)) return true;
  return plan_.freeze && tick >= ticks_of(plan_.freeze->at) &&
         tick < ticks_of(plan_.freeze->at) + ticks_of(plan_.freeze->duration);
}

const Perception::Joints& Perception::delayed(const Joints& partner) {
  newest_ = (newest_ + 1) % past_.size();
  past_[newest_] = partner;
  return past_[(newest_ + 1) % past_.size()];  // the oldest
}

void Perception::measure(int tick, const Joints& partner) {
  const bool jumped = plan_.jump && tick >= ticks_of(plan_.jump->at);
  const bool holds = held(tick);
  for (int j = 0; j < static_cast<int>(partner.cols()); ++j) {
    Eigen::Vector3d p_W = partner.col(j);
    if (jumped) p_W += jump_;
    if (plan_.jitter > 0.0)
      for (double& x : p_W) x += plan_.jitter * jitter_.normal();
    const bool dropped = plan_.dropout > 0.0 && dropout_.chance(plan_.dropout);
    if (!holds && (tick == 0 || !dropped)) seen_.col(j) = p_W;
  }
}

}  // namespace duet
