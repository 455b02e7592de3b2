#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "duet/datasets/annotations.h"

namespace duet {
namespace {

using ::testing::ElementsAre;

TEST(PhaseErrors, TheTableIsOfTheirSizes) {
  const std::vector<PhaseError> errors = {{.task = Task::kHug, .begin = -0.2, .end = 0.4, .overlap = 0.8},
                                          {.task = Task::kHug, .begin = 0.4, .end = 0.0, .overlap = 1.0},
                                          {.task = Task::kWave, .begin = 0.0, .end = -1.0, .overlap = 0.5}};
  const TextTable table = phase_error_table(errors);
  ASSERT_EQ(table.rows.size(), 3U);
  EXPECT_THAT(table.rows[0], ElementsAre("hug", "2", "0.30", "0.38", "0.20", "0.36", "0.90"));
  EXPECT_THAT(table.rows[1], ElementsAre("wave", "1", "0.00", "0.00", "1.00", "1.00", "0.50"));
  EXPECT_EQ(table.rows[2][1], "3");
}

TEST(PhaseErrors, ProposalsFindTheActThatSynthesisKnows) {
  const std::vector<PhaseError> errors = phase_errors(kPaperTasks, 3, 11, 2);
  ASSERT_EQ(errors.size(), 18U);
  for (const PhaseError& error : errors) {
    EXPECT_GT(error.overlap, 0.7) << to_string(error.task);
    EXPECT_LT(std::abs(error.begin), 1.5) << to_string(error.task);
    EXPECT_LT(std::abs(error.end), 1.5) << to_string(error.task);
  }
}

TEST(PhaseErrors, DoNotDependOnTheThreads) {
  const std::vector<PhaseError> one = phase_errors(kPaperTasks, 2, 3, 1), four = phase_errors(kPaperTasks, 2, 3, 4);
  for (std::size_t i = 0; i < one.size(); ++i) {
    EXPECT_EQ(one[i].begin, four[i].begin);
    EXPECT_EQ(one[i].end, four[i].end);
  }
}

}  // namespace
}  // namespace duet
