#include "bench/score.h"

#include <gtest/gtest.h>

#include <cmath>

#include "tests/bench/fixtures.h"

namespace duet {
namespace {

TEST(Score, ContactFiguresAreMicroAveraged) {
  ClipScore a, b;
  a.task = b.task = "hug";
  a.clip = "a";
  b.clip = "b";
  for (const char* name : {"contact_precision_0.2", "contact_recall_0.2", "contact_f1_0.2", "contact_accuracy_0.2"})
    a.metrics[name] = b.metrics[name] = std::nan("");
  a.contacts[0] = {90, 0, 10, 0};
  b.contacts[0] = {0, 10, 0, 90};
  const auto summary = summarize_scores({a, b}, {});
  EXPECT_DOUBLE_EQ(summary.at("all").at("contact_precision_0.2"), 0.9);
  EXPECT_DOUBLE_EQ(summary.at("all").at("contact_recall_0.2"), 0.9);
  EXPECT_DOUBLE_EQ(summary.at("hug").at("contact_accuracy_0.2"), 0.9);
}

TEST(Score, UndefinedFiguresStayOutOfMeans) {
  ClipScore a, b;
  a.task = b.task = "hug";
  a.metrics["jpe"] = 0.2;
  b.metrics["jpe"] = std::nan("");
  EXPECT_DOUBLE_EQ(summarize_scores({a, b}, {}).at("hug").at("jpe"), 0.2);
}

TEST(Score, RetargetedClipHasAllEighteenAndTwoOtherReadings) {
  const auto robot = test::g1();
  const ClipScore score = score_clip(test::paired(Task::kHandshake, *robot), robot, {});
  EXPECT_EQ(score.metrics.size(), 20u);
  EXPECT_LT(score.metrics.at("large_angle_ratio.entry"), score.metrics.at("large_angle_ratio"));
  EXPECT_TRUE(score.source_detected);
  EXPECT_TRUE(score.robot_detected);
  EXPECT_NE(score_table(summarize_scores({score}, {})).find("jpe"), std::string::npos);
  EXPECT_EQ(score_json({score}, summarize_scores({score}, {})).at("clips").size(), 1u);
}

}  // namespace
}  // namespace duet
