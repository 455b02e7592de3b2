#include <fmt/format.h>
#include <gmock/gmock.h>

#include "duet/core/file.h"
#include "duet/metrics/detector.h"
#include "tests/support.h"

namespace duet {
namespace {

using ::testing::HasSubstr;

// Nothing that a detector prints is without unit and meaning.
TEST(DetectorCatalogue, EveryFigureAndThresholdIsInTheCatalogue) {
  for (const Task task : all_tasks()) {
    for (const auto& [name, value] : thresholds(task)) EXPECT_FALSE(threshold_info(task, name).meaning.empty());
    Agent agent;
    for (Eigen::Matrix3Xd* track :
         {&agent.lhand, &agent.rhand, &agent.head, &agent.root, &agent.torso, &agent.lshoulder, &agent.rshoulder})
      *track = Eigen::Matrix3Xd::Random(3, 40);
    const DetectorResult result = detect(task, agent, agent, DetectorVersion::kRobot);
    EXPECT_EQ(result.values.size(), detector_figures(task).size()) << to_string(task);
    for (const auto& [name, value] : result.values) EXPECT_EQ(detector_figure(task, name).name, name);
  }
  EXPECT_SENTENCE(
      test::thrown_message<std::invalid_argument>([] { (void)detector_figure(Task::kHug, "hands_distance"); }));
}

TEST(DetectorCatalogue, RulesOfTheSetActHaveUnitsAndMeanings) {
  for (const Task task : all_tasks()) {
    Agent agent;
    for (Eigen::Matrix3Xd* track :
         {&agent.lhand, &agent.rhand, &agent.head, &agent.root, &agent.torso, &agent.lshoulder, &agent.rshoulder})
      *track = Eigen::Matrix3Xd::Random(3, 40);
    const DetectorResult result = detect(task, agent, agent, DetectorVersion::kRobot, ThresholdSet::kAct);
    const std::size_t figures = rule_figures(task).empty() ? detector_figures(task).size() : rule_figures(task).size();
    EXPECT_EQ(result.values.size(), figures) << to_string(task);
    for (const auto& [name, value] : result.values)
      EXPECT_EQ(detector_figure(task, name, ThresholdSet::kAct).name, name);
    for (const auto& [name, value] : thresholds(task, ThresholdSet::kAct))
      EXPECT_FALSE(threshold_unit(task, name, ThresholdSet::kAct).empty()) << to_string(task) << " " << name;
  }
  EXPECT_EQ(threshold_unit(Task::kHug, "hold", ThresholdSet::kAct), "s");
  EXPECT_EQ(threshold_unit(Task::kBend, "angle", ThresholdSet::kAct), "rad");
}

TEST(DetectorCatalogue, StrictChoicesAreTheReadingsThatTheSetBrings) {
  using Choices = std::vector<std::pair<std::string, std::string>>;
  EXPECT_EQ(strict_choices(Task::kBend), (Choices{{"bend.direction", "forward"}}));
  EXPECT_EQ(strict_choices(Task::kFlyKiss), (Choices{{"fly_kiss.order", "after_closest"}}));
  EXPECT_TRUE(strict_choices(Task::kHug).empty());
}

// docs/detectors.md has every line of both tables.
TEST(DetectorCatalogue, TheDocsHaveEveryThresholdAndFigure) {
  const std::string docs = read_file(fmt::format("{}/docs/detectors.md", DUET_SOURCE_DIR));
  for (const Task task : all_tasks()) {
    for (const ThresholdInfo& info : threshold_catalogue(task))
      EXPECT_THAT(docs, HasSubstr(fmt::format("| `{}` | {:g} | {:g} | {} | {} |", info.name, info.paper, info.strict,
                                              info.unit, info.meaning)));
    for (const DetectorFigure& figure : detector_figures(task))
      EXPECT_THAT(docs, HasSubstr(fmt::format("| `{}` | {} | {} |", figure.name, figure.unit, figure.meaning)));
    for (const auto& [option, value] : strict_choices(task))
      EXPECT_THAT(docs, HasSubstr(fmt::format("`{}={}`", option, value)));
    for (const RuleThreshold& threshold : rule_thresholds(task))
      EXPECT_THAT(docs, HasSubstr(fmt::format("| `{}` | {:g} | {} | {} |", threshold.name, threshold.value,
                                              threshold.unit, threshold.meaning)));
    for (const DetectorFigure& figure : rule_figures(task))
      EXPECT_THAT(docs, HasSubstr(fmt::format("| `{}` | {} | {} |", figure.name, figure.unit, figure.meaning)));
  }
}

}  // namespace
}  // namespace duet
