#include <gtest/gtest.h>

#include "duet/retarget/solver/lbfgs.h"

namespace duet {
namespace {

// L D L^T has on its diagonals D (1 + f^2 + s^2), D (f + f s) and D s.
TEST(TemporalFactor, ItsProductIsTheFiveBands) {
  for (const double stiffness : {0.01, 1.0, 50.0})
    for (const double velocity : {0.0, 3.0})
      for (const double acceleration : {0.0, 0.5, 40.0}) {
        const auto [first, second, scale] = temporal_factor(stiffness, velocity, acceleration);
        const double D = scale * scale, size = stiffness + 2.0 * velocity + 6.0 * acceleration;
        EXPECT_NEAR(D * (1.0 + first * first + second * second), size, 1e-6 * size);
        EXPECT_NEAR(D * (first + first * second), -velocity - 4.0 * acceleration, 1e-6 * size);
        EXPECT_NEAR(D * second, acceleration, 1e-6 * size);
      }
}

}  // namespace
}  // namespace duet
