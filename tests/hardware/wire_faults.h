// Faults between twin and guard, as functions of the states that are under way (GuardedTwin::spoil). Each
// keeps what it needs; one is for one run.
#pragma once

#include <algorithm>
#include <functional>

#include "duet/core/numbers.h"
#include "tests/hardware/guarded_twin.h"

namespace duet::test {

using Frames = GuardedTwin::Frames;
using SpoiledFrames = std::function<void(Frames&)>;

// With a checksum that is right again.
inline SpoiledFrames in_each(const std::function<void(LowStateFrame&)>& change) {
  return [change](Frames& frames) {
    for (LowStateFrame& frame : frames) {
      change(frame);
      seal(frame);
    }
  };
}

inline void flip_a_bit(LowStateFrame& frame) { reinterpret_cast<unsigned char*>(&frame)[100] ^= 4; }

inline SpoiledFrames flipped(int every) {
  return [every, k = 0](Frames& frames) mutable {
    if (++k % every == 0) std::for_each(frames.begin(), frames.end(), flip_a_bit);
  };
}

inline SpoiledFrames flipped_by_chance(double share) {
  return [share, random = Random(41, 9)](Frames& frames) mutable {
    if (random.chance(share)) std::for_each(frames.begin(), frames.end(), flip_a_bit);
  };
}

inline SpoiledFrames dropped(double share) {
  return [share, random = Random(19, 8)](Frames& frames) mutable {
    if (random.chance(share)) frames.clear();
  };
}

inline SpoiledFrames frozen() {
  return [tick = 0u](Frames& frames) mutable {
    for (LowStateFrame& frame : frames) {
      if (tick == 0u) tick = frame.tick;
      frame.tick = tick;
      seal(frame);
    }
  };
}

// Everything comes `ticks` late from now on.
inline SpoiledFrames delayed(std::size_t ticks) {
  return [ticks, waiting = Frames()](Frames& frames) mutable {
    waiting.insert(waiting.end(), frames.begin(), frames.end());
    frames.clear();
    if (waiting.size() <= ticks) return;
    frames.push_back(waiting.front());
    waiting.pop_front();
  };
}

// For so many ticks, and nothing afterwards.
inline SpoiledFrames for_ticks(int ticks, const SpoiledFrames& spoil) {
  return [spoil, left = ticks](Frames& frames) mutable {
    if (left-- > 0) spoil(frames);
  };
}

}  // namespace duet::test
