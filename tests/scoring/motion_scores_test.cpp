#include "duet/scoring/motion_scores.h"

#include <gtest/gtest.h>

#include <cmath>

#include "tests/experiment/fixtures.h"

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

TEST(Score, RetargetedClipHasTheEighteenTwoOtherReadingsAndHowItStands) {
  const auto robot = test::g1();
  const ClipScore score = score_clip(test::paired(Task::kHandshake, *robot), robot, {});
  EXPECT_EQ(score.metrics.size(), 18u + 2u + 14u);
  EXPECT_LT(score.metrics.at("large_angle_ratio.entry"), score.metrics.at("large_angle_ratio"));
  EXPECT_TRUE(score.source_detected);
  EXPECT_TRUE(score.robot_detected);
  EXPECT_NE(score_table(summarize_scores({score}, {})).find("jpe"), std::string::npos);
  EXPECT_EQ(score_json({score}, summarize_scores({score}, {})).at("clips").size(), 1u);
}

TEST(Score, TheTableHasTheGroupsOfAMotionAndNoOther) {
  std::map<std::string, double> figures = {{"clips", 1.0},          {"jpe", 0.1},           {"jpe.pelvis", 0.2},
                                           {"sole_height", 0.3},    {"hf_ratio", 0.4},      {"source_detected", 1.0},
                                           {"robot_detected", 1.0}, {"paper_detected", 1.0}};
  const std::string table = score_table({{"hug", figures}});
  for (const char* row : {"jpe ", "jpe.pelvis", "sole_height "})
    EXPECT_NE(table.find(std::string("\n") + row), std::string::npos) << row;
  EXPECT_EQ(table.find("hf_ratio"), std::string::npos);
  EXPECT_EQ(table.find("awd"), std::string::npos) << "which the summary does not have";
}

// The whole way of a clip, person to robot to figures, as it is. The kernel without fused operations is the one whose
// rounding does not depend on the processor; what is left is a compiler's.
TEST(Score, TheFirstClipOfEachTaskScoresAsItDid) {
  constexpr double kSame = 1e-3;  // of each figure: jerk is a third difference of what an optimiser in float found
  const std::vector<std::string> names = {"angle_std", "awd",        "jerk_mean",
                                          "jpe",       "jpe.pelvis", "large_angle_ratio.entry"};
  const std::map<Task, std::vector<double>> record = {
      {Task::kHug, {0.295418301, 0.028249203, 56.5639872, 0.0599493071, 0.0476409161, 0.122796519}},
      {Task::kHandshake, {0.259851616, 0.0287320831, 22.8184734, 0.0549916362, 0.060069528, 0.083015104}},
      {Task::kHighFive, {0.278419106, 0.0357183853, 24.1236419, 0.0599123788, 0.0674620892, 0.0909488838}},
      {Task::kWave, {0.282289481, 0.0315934998, 37.0684784, 0.0588530214, 0.0671632873, 0.109636533}},
      {Task::kBend, {0.249882069, 0.0305859276, 18.6032001, 0.0493373376, 0.0516564917, 0.112269447}},
      {Task::kFlyKiss, {0.278046477, 0.0366114074, 15.7353302, 0.0545002527, 0.0605572013, 0.13220047}}};
  const auto robot = test::g1();
  PairOptions options;
  options.kernel = KernelKind::kV2;
  for (const auto& [task, figures] : record) {
    const ClipScore score = score_clip(retarget(synthesize(task, {}), *robot, options), robot, {});
    for (std::size_t i = 0; i < names.size(); ++i)
      EXPECT_NEAR(score.metrics.at(names[i]) / figures[i], 1.0, kSame) << to_string(task) << " " << names[i];
    EXPECT_TRUE(score.source_detected && score.robot_detected && score.paper_detected) << to_string(task);
  }
}

}  // namespace
}  // namespace duet
