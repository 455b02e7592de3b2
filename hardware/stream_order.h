// The one rule for the sequence numbers of what comes over a socket, be it a planner, a tracker or who estimates the
// person: a number that does not rise is old, and its message dropped. A program that was started anew counts from a
// low number again: after a pause its stream is taken again at the second of two numbers that rise. One number that
// is repeated for ever is no such stream: whoever hangs is not heard. One owner.
#pragma once

#include <cstdint>
#include <optional>

namespace duet {

inline constexpr double kStreamPause = 1.0;  // since a message was taken [s]; longer than any stream here may be silent

class StreamOrder {
 public:
  // Whether the message with this number, received at `now` [s], is to be taken.
  bool takes(std::uint64_t sequence, double now) {
    if (last_ && sequence <= *last_) {
      const bool paused = now - taken_at_ > kStreamPause, rises = old_one_ && sequence > *old_one_;
      old_one_ = sequence;
      if (!paused || !rises) {
        ++old_;
        return false;
      }
      ++restarts_;
    }
    last_ = sequence;
    taken_at_ = now;
    old_one_.reset();
    return true;
  }
  [[nodiscard]] long old() const { return old_; }            // dropped
  [[nodiscard]] long restarts() const { return restarts_; }  // streams that were taken again

 private:
  std::optional<std::uint64_t> last_, old_one_;  // `old_one_`: the last that was not taken, since one was
  double taken_at_ = 0.0;
  long old_ = 0, restarts_ = 0;
};

}  // namespace duet
