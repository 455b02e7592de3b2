#include "duet/policies/dstar/past_frames.h"

#include <algorithm>
#include <iterator>

#include "duet/core/require.h"

namespace duet {

void PastFrames::add(const Observation& observation) {
  const int count = static_cast<int>(observation.history.size()), first = observation.tick - count + 1;
  while (!seen_.empty() && seen_.back().tick >= first) seen_.pop_back();
  for (int i = 0; i < count; ++i) seen_.push_back({first + i, observation.history[i]});
  // One at or before the oldest tick looked at is kept, for ticks that were not seen.
  const int oldest = observation.tick - (kHistoryFrames - 1) * stride_;
  while (seen_.size() > 1 && seen_[1].tick <= oldest) seen_.pop_front();
}

std::span<const ObservationFrame> PastFrames::frames() {
  require(!seen_.empty(), "D-STAR's past: no observation yet");
  for (int i = 0; i < kHistoryFrames; ++i) {
    const int tick = seen_.back().tick - (kHistoryFrames - 1 - i) * stride_;
    const auto later = std::ranges::upper_bound(seen_, tick, {}, &Seen::tick);
    frames_[i] = (later == seen_.begin() ? later : std::prev(later))->frame;
  }
  return frames_;
}

}  // namespace duet
