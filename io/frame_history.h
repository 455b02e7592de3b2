// The last frames of numbers that a network is shown, oldest first. Histories of whole frames (frame-major) are one of
// these; histories of each term by itself (term-major) are one for each. Nothing allocates after construction.
#pragma once

#include <span>
#include <vector>

namespace duet {

struct HistoryRule {
  int frames = 1;            // the current one counted where it is among them
  bool current = true;       // whether the current frame is the last of them
  bool starts_full = false;  // before the first frame: that frame repeated, else zeros
};

class FrameHistory {
 public:
  FrameHistory(int frame_size, const HistoryRule& rule);

  [[nodiscard]] int size() const { return static_cast<int>(past_.size()); }  // of all that is shown
  void reset();
  // Takes a frame and writes what is shown with it: `out` has size() numbers.
  void add(std::span<const float> frame, std::span<float> out);

 private:
  HistoryRule rule_;
  int frame_size_;
  bool first_ = true;
  std::vector<float> past_;  // oldest first
};

}  // namespace duet
