// Mean and minimum over the last samples of a signal that arrives one by one. The signal counts as zero before its
// first sample. No allocation after construction.
#pragma once

#include <cstddef>
#include <cstdint>
#include <numeric>
#include <vector>

namespace duet {

class SlidingMean {
 public:
  explicit SlidingMean(int length) : samples_(length, 0.0) {}

  // The mean over the last `length` samples, this one included.
  double push(double sample) {
    sum_ += sample - samples_[next_];
    samples_[next_] = sample;
    if (++next_ == samples_.size()) {
      next_ = 0;
      sum_ = std::accumulate(samples_.begin(), samples_.end(), 0.0);  // rounding errors live one window at most
    }
    return sum_ / static_cast<double>(samples_.size());
  }

  void clear() {
    samples_.assign(samples_.size(), 0.0);
    next_ = 0;
    sum_ = 0.0;
  }

 private:
  std::vector<double> samples_;
  std::size_t next_ = 0;
  double sum_ = 0.0;
};

class SlidingMinimum {
 public:
  explicit SlidingMinimum(int length) : candidates_(length) {}

  // The minimum over the last `length` samples, this one included; 0 before there are so many. Samples are >= 0.
  double push(double sample) {
    const auto length = static_cast<std::int64_t>(candidates_.size());
    if (size_ > 0 && candidates_[first_].index <= count_ - length) {
      first_ = (first_ + 1) % candidates_.size();
      --size_;
    }
    while (size_ > 0 && last().sample >= sample) --size_;
    ++size_;
    last() = {count_++, sample};
    return count_ < length ? 0.0 : candidates_[first_].sample;
  }

 private:
  struct Candidate {
    std::int64_t index = 0;
    double sample = 0.0;
  };

  Candidate& last() { return candidates_[(first_ + size_ - 1) % candidates_.size()]; }

  std::vector<Candidate> candidates_;  // ring: samples that may still become the minimum, rising
  std::size_t first_ = 0, size_ = 0;
  std::int64_t count_ = 0;
};

}  // namespace duet
