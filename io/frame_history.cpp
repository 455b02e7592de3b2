#include "duet/io/frame_history.h"

#include <algorithm>

namespace duet {

FrameHistory::FrameHistory(int frame_size, const HistoryRule& rule)
    : rule_(rule), frame_size_(frame_size), past_(static_cast<std::size_t>(frame_size) * rule.frames) {}

void FrameHistory::reset() {
  first_ = true;
  std::ranges::fill(past_, 0.0F);
}

void FrameHistory::add(std::span<const float> frame, std::span<float> out) {
  if (first_ && rule_.starts_full)
    for (int k = 0; k < rule_.frames; ++k) std::ranges::copy(frame, past_.begin() + k * frame_size_);
  first_ = false;
  if (!rule_.current) std::ranges::copy(past_, out.begin());
  std::copy(past_.begin() + frame_size_, past_.end(), past_.begin());
  std::ranges::copy(frame, past_.end() - frame_size_);
  if (rule_.current) std::ranges::copy(past_, out.begin());
}

}  // namespace duet
