#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <numeric>

#include "duet/core/numbers.h"
#include "duet/statistics/clustered.h"

namespace duet {
namespace {

// Printed tables of Student's distribution.
TEST(StudentQuantile, IsThatOfTheTables) {
  struct Case {
    double level, degrees, t;
  };
  for (const auto& [level, degrees, t] : {Case{0.95, 1, 12.7062}, Case{0.95, 2, 4.30265}, Case{0.95, 4, 2.77645},
                                          Case{0.95, 10, 2.22814}, Case{0.99, 4, 4.60409}, Case{0.90, 30, 1.69726}})
    EXPECT_NEAR(student_quantile(level, degrees), t, 5e-5) << level << " " << degrees;
  EXPECT_NEAR(student_quantile(0.95, 1e7), normal_quantile(0.975), 1e-5);
}

// One degree of freedom is Cauchy's distribution, two have a closed form.
TEST(StudentTwoSided, AgreesWithItsClosedForms) {
  for (const double t : {0.0, 0.1, 1.0, -1.0, 3.0, 40.0}) {
    EXPECT_NEAR(student_two_sided(t, 1.0), 1.0 - 2.0 / std::numbers::pi * std::atan(std::abs(t)), 1e-12) << t;
    EXPECT_NEAR(student_two_sided(t, 2.0), 1.0 - std::abs(t) / std::sqrt(2.0 + t * t), 1e-12) << t;
  }
  EXPECT_GT(student_two_sided(2.0, 2.5), student_two_sided(2.0, 3.0));  // not only whole numbers
  EXPECT_LT(student_two_sided(2.0, 2.5), student_two_sided(2.0, 2.0));
}

// By hand: A succeeds in 4/4 and 2/4, B in 1/4 and 1/4. Clips 0, 0, 1, 1.
TEST(CrossedDifference, ItsErrorIsThatOfTrainingsAndOfClips) {
  const TrainingOutcomes a = {{1, 1, 1, 1}, {1, 1, 0, 0}}, b = {{1, 0, 0, 0}, {1, 0, 0, 0}};
  const std::vector<int> clip = {0, 0, 1, 1};
  const CrossedDifference found = crossed_difference(a, b, clip);
  EXPECT_DOUBLE_EQ(found.difference, 0.5);
  // Trainings of A: 1 and .5, so s^2 = .125, over 2. Clips: the differences per episode are 0, 1, .5, .5: both clips
  // are where the mean is.
  EXPECT_DOUBLE_EQ(found.error, std::sqrt(0.0625));
  EXPECT_DOUBLE_EQ(found.of_trainings, 1.0);
  EXPECT_DOUBLE_EQ(found.degrees, 1.0);
  EXPECT_NEAR(found.p, 1.0 - 2.0 / std::numbers::pi * std::atan(2.0), 1e-12);
  EXPECT_NEAR(found.interval.high, 0.5 + 12.7062 * 0.25, 1e-4);
  EXPECT_NEAR(found.interval.low, 0.5 - 12.7062 * 0.25, 1e-4);
}

// By hand: no spread of trainings; clips of 1 and of 3 episodes differ by 1 and 1/3 each.
TEST(CrossedDifference, ClipsOfUnequalSizeAreDrawnAsWholes) {
  const TrainingOutcomes a = {{1, 1, 0, 0}, {1, 1, 0, 0}}, b = {{0, 0, 0, 0}, {0, 0, 0, 0}};
  const std::vector<int> clip = {7, 3, 3, 3};
  const CrossedDifference found = crossed_difference(a, b, clip);
  EXPECT_DOUBLE_EQ(found.difference, 0.5);
  // Sums off the mean: .5 and -.5; 2 / 1 (.25 + .25) / 16.
  EXPECT_DOUBLE_EQ(found.error, 0.25);
  EXPECT_DOUBLE_EQ(found.of_trainings, 0.0);
  EXPECT_DOUBLE_EQ(found.degrees, 1.0);
}

TEST(CrossedDifference, WithoutAnySpreadTheClipsSayHowSureItIs) {
  const std::vector<int> clip = {0, 1};
  const CrossedDifference apart = crossed_difference({{1, 1}, {1, 1}}, {{0, 0}, {0, 0}}, clip);
  EXPECT_EQ(apart.p, 0.5);  // two clips of two
  EXPECT_LT(apart.interval.low, 0.2);
  EXPECT_EQ(apart.interval.high, 1.0);
  EXPECT_EQ(crossed_difference({{1, 1}, {1, 1}}, {{1, 1}, {1, 1}}, clip).p, 1.0);
}

TEST(CrossedDifference, RefusesWhatSaysNothing) {
  const std::vector<int> clip = {0, 1}, one = {5, 5};
  const TrainingOutcomes two = {{1, 0}, {1, 1}}, single = {{1, 0}}, unequal = {{1, 0}, {1}};
  EXPECT_THROW(crossed_difference(single, two, clip), std::invalid_argument);
  EXPECT_THROW(crossed_difference(two, single, clip), std::invalid_argument);
  EXPECT_THROW(crossed_difference(two, unequal, clip), std::invalid_argument);
  EXPECT_THROW(crossed_difference(two, two, one), std::invalid_argument);
}

// Two methods that are one: three trainings of each are 6 points apart by chance, and clips are of unlike difficulty.
struct NullWorld {
  static constexpr int kTrainings = 3, kClips = 20, kOfEach = 4;

  explicit NullWorld(std::uint64_t seed) {
    Random random(seed, stream_key({"null world"}));
    std::vector<double> ease(kClips);
    for (double& each : ease) each = 0.7 + 0.2 * random.normal();
    for (TrainingOutcomes* method : {&a, &b}) {
      method->resize(kTrainings);
      for (std::vector<double>& training : *method) {
        const double better = 0.06 * random.normal();
        for (int i = 0; i < kClips * kOfEach; ++i)
          training.push_back(random.uniform() < ease[i / kOfEach] + better ? 1.0 : 0.0);
      }
    }
    for (int i = 0; i < kClips * kOfEach; ++i) clip.push_back(i / kOfEach);
  }

  // As though the episodes of all trainings were independent pairs.
  [[nodiscard]] double pooled_p() const {
    long only_a = 0, only_b = 0;
    for (int training = 0; training < kTrainings; ++training)
      for (std::size_t i = 0; i < clip.size(); ++i) {
        only_a += a[training][i] > b[training][i] ? 1 : 0;
        only_b += a[training][i] < b[training][i] ? 1 : 0;
      }
    return mcnemar_exact(only_a, only_b);
  }

  TrainingOutcomes a, b;
  std::vector<int> clip;
};

// An error of the first kind in at most 5 % of the runs; a test that takes trainings for nothing makes three times as
// many.
TEST(CrossedDifference, HoldsItsLevelWhereTrainingsDiffer) {
  constexpr int kWorlds = 4000;
  int crossed = 0, pooled = 0;
  for (int i = 0; i < kWorlds; ++i) {
    const NullWorld world(i);
    crossed += crossed_difference(world.a, world.b, world.clip).p <= 0.05 ? 1 : 0;
    pooled += world.pooled_p() <= 0.05 ? 1 : 0;
  }
  EXPECT_LE(crossed, 0.055 * kWorlds);
  EXPECT_GE(crossed, 0.005 * kWorlds);  // and it is not deaf
  EXPECT_GE(pooled, 0.15 * kWorlds);
}

}  // namespace
}  // namespace duet
