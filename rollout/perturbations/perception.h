// Disturbances of a policy's view of its partner: noise, dropouts, latency, and faults of a tracker. They change
// ObservationFrame::partner alone; physics, detectors and recording have the real partner.
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "duet/core/random.h"
#include "duet/policies/policy.h"

namespace duet {

// The partner is seen as at `at` for so long.
struct PerceptionFreeze {
  double at = 2.0, duration = 1.0;  // [s]
};

// From `at` on every joint is seen so far from its place, level, in a direction drawn for the episode.
struct PerceptionJump {
  double at = 2.0, metres = 0.3;
};

struct PerceptionPlan {
  double jitter = 0.0;           // standard deviation on each axis of each joint, drawn anew every tick [m]
  double dropout = 0.0;          // probability per joint and tick; such a joint keeps its last seen place
  double latency_ms = 0.0;       // the partner is seen as so long ago, to the nearest tick; at first as at the start
  std::optional<double> vanish;  // from then on the partner is not seen: the last seen pose stays [s]
  std::optional<PerceptionFreeze> freeze;
  std::optional<PerceptionJump> jump;
};

// A plan at work in one episode. Nothing allocates after construction; not thread-safe.
class Perception {
 public:
  using Joints = Eigen::Matrix<double, 3, kSmplJoints>;

  // The seed's streams are its own: other perturbations of the episode draw the same with and without it.
  Perception(const PerceptionPlan& plan, std::uint64_t seed);
  // The partner as it is seen at this tick (50 Hz); once per tick, ticks from 0 in order.
  const Joints& seen(int tick, const Joints& partner);

 private:
  [[nodiscard]] bool held(int tick) const;
  const Joints& delayed(const Joints& partner);
  void measure(int tick, const Joints& partner);

  PerceptionPlan plan_;
  Random jitter_, dropout_;
  Eigen::Vector3d jump_ = Eigen::Vector3d::Zero();
  std::vector<Joints> past_;  // a ring as long as the latency, the current one included
  std::size_t newest_ = 0;
  Joints seen_;
};

}  // namespace duet
