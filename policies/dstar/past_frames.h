// The past that D-STAR's long stream looks back on: frames further apart, kept over an episode, of which an observation
// only brings the newest. One owner, not thread-safe.
#pragma once

#include <array>
#include <deque>
#include <span>

#include "duet/policies/policy.h"

namespace duet {

class PastFrames {
 public:
  // `stride`: ticks between the frames, 1 or more.
  explicit PastFrames(int stride) : stride_(stride) {}
  void reset() { seen_.clear(); }
  // Keeps the frames of an observation; what was kept of its ticks or later ones is replaced.
  void add(const Observation& observation);
  // kHistoryFrames frames, `stride` ticks apart, the newest last. For a tick that was not seen: the last one before it,
  // or the first of all. Valid until the next call. Throws std::invalid_argument before the first add.
  std::span<const ObservationFrame> frames();

 private:
  struct Seen {
    int tick;
    ObservationFrame frame;
  };
  int stride_;
  std::deque<Seen> seen_;  // oldest first
  std::array<ObservationFrame, kHistoryFrames> frames_;
};

}  // namespace duet
