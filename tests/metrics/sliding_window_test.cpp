#include <gtest/gtest.h>

#include <algorithm>
#include <vector>

#include "duet/metrics/contact_safety.h"

namespace duet {
namespace {

// Signals with plateaus, ties and zeros.
std::vector<double> nasty_signal(int size) {
  std::vector<double> signal;
  for (int k = 0; k < size; ++k) signal.push_back(k % 7 == 0 ? 0.0 : static_cast<double>((k * k * 31 + k / 5) % 11));
  return signal;
}

TEST(SlidingWindow, AgreesWithTheDefinition) {
  const std::vector<double> signal = nasty_signal(200);
  for (const int length : {1, 2, 3, 10, 199, 200, 250}) {
    SlidingMean mean(length);
    SlidingMinimum minimum(length);
    for (int k = 0; k < 200; ++k) {
      const auto last = signal.begin() + k + 1, first = signal.begin() + std::max(0, k + 1 - length);
      EXPECT_NEAR(mean.push(signal[k]), std::accumulate(first, last, 0.0) / length, 1e-13) << length << ' ' << k;
      EXPECT_EQ(minimum.push(signal[k]), k + 1 < length ? 0.0 : *std::min_element(first, last)) << length << ' ' << k;
    }
  }
}

TEST(SlidingMean, AVeryLargeSampleLeavesNothingBehind) {
  SlidingMean mean(10);
  mean.push(1e18);
  for (int k = 0; k < 19; ++k) mean.push(1.0);
  EXPECT_EQ(mean.push(1.0), 1.0);
}

TEST(SlidingMean, ClearForgets) {
  SlidingMean mean(4);
  mean.push(8.0);
  mean.clear();
  EXPECT_EQ(mean.push(4.0), 1.0);
}

}  // namespace
}  // namespace duet
