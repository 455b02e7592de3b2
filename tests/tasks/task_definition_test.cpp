// Laws of every task's definition, whichever tasks there are.
#include "duet/tasks/task_definition.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <limits>
#include <map>
#include <set>
#include <string>

#include "duet/tasks/rules/evidence.h"

namespace duet {
namespace {

TEST(TaskDefinition, IsFoundByTheNameOfItsTask) {
  for (const Task task : all_tasks()) EXPECT_EQ(definition_of(task).name, to_string(task));
}

TEST(TaskDefinition, HasWordsOfItsOwn) {
  std::map<std::string_view, std::string_view> owners;
  std::set<std::string_view> prompts;
  for (const Task task : all_tasks()) {
    const TaskDefinition& definition = definition_of(task);
    EXPECT_TRUE(prompts.insert(definition.prompt).second) << definition.prompt;
    EXPECT_FALSE(definition.phrases.empty()) << definition.name;
    EXPECT_GE(definition.paraphrases.size(), 8U) << definition.name;
    for (const TaskPhrase& entry : definition.phrases) {
      const auto [owner, is_new] = owners.try_emplace(entry.phrase, definition.name);
      EXPECT_TRUE(is_new) << "'" << entry.phrase << "' of " << definition.name << " and " << owner->second;
      EXPECT_GT(entry.weight, 0.0) << entry.phrase;
      EXPECT_LE(entry.weight, 1.0) << entry.phrase;
    }
  }
}

TEST(TaskDefinition, HasAnActThatCanBeStaged) {
  for (const Task task : all_tasks()) {
    const synthesis::Act& act = definition_of(task).act;
    EXPECT_NE(act.layout, nullptr) << to_string(task);
    EXPECT_NE(act.perform, nullptr) << to_string(task);
    EXPECT_GT(act.shortest, 0.0) << to_string(task);
    EXPECT_LE(act.shortest, act.longest) << to_string(task);
    EXPECT_LT(act.longest, act.mean_seconds) << to_string(task);
    EXPECT_LE(act.lowest, act.highest) << to_string(task);
  }
}

TEST(TaskDefinition, HasADetectorWhoseNamesDiffer) {
  for (const Task task : all_tasks()) {
    const TaskDetector& detector = definition_of(task).detector;
    EXPECT_NE(detector.tracks, nullptr) << to_string(task);
    EXPECT_NE(detector.detect, nullptr) << to_string(task);
    std::set<std::string_view> thresholds, figures;
    for (const ThresholdInfo& info : detector.thresholds)
      EXPECT_TRUE(thresholds.insert(info.name).second) << to_string(task) << " " << info.name;
    for (const DetectorFigure& figure : detector.figures)
      EXPECT_TRUE(figures.insert(figure.name).second) << to_string(task) << " " << figure.name;
    EXPECT_FALSE(thresholds.empty()) << to_string(task);
    EXPECT_FALSE(figures.empty()) << to_string(task);
  }
}

constexpr double kInfinity = std::numeric_limits<double>::infinity();

Eigen::ArrayXd array(std::initializer_list<double> values) {
  Eigen::ArrayXd result(values.size());
  std::copy(values.begin(), values.end(), result.begin());
  return result;
}

TEST(FrameWindows, LongestRunCountsConsecutiveFrames) {
  EXPECT_EQ(longest_run({}), 0);
  EXPECT_EQ(longest_run({false, false}), 0);
  EXPECT_EQ(longest_run({true}), 1);
  EXPECT_EQ(longest_run({true, true, false, true, true, true}), 3);
  EXPECT_EQ(longest_run({true, true, true, false, true}), 3);
  EXPECT_EQ(count_frames({true, false, true, true}), 3);
}

TEST(FrameWindows, ComparisonsAreStrictWhereTheyAreCalledSo) {
  const Eigen::ArrayXd x = array({1.0, 2.0, 3.0});
  EXPECT_EQ(below(x, 2.0), (FrameMask{true, false, false}));
  EXPECT_EQ(at_most(x, 2.0), (FrameMask{true, true, false}));
  EXPECT_EQ(above(x, 2.0), (FrameMask{false, false, true}));
  EXPECT_EQ(at_least(x, 2.0), (FrameMask{false, true, true}));
  EXPECT_EQ(both({true, true, false}, {true, false, false}), (FrameMask{true, false, false}));
  EXPECT_EQ(either({true, false, false}, {false, false, true}), (FrameMask{true, false, true}));
}

TEST(FrameWindows, FramesNeededIsTheNextWholeNumberFromOne) {
  EXPECT_EQ(frames_needed(3.0), 3);
  EXPECT_EQ(frames_needed(2.5), 3);
  EXPECT_EQ(frames_needed(0.0), 1);
  EXPECT_EQ(frames_needed(-4.0), 1);
  EXPECT_EQ(frames_needed(1e300), 1000000000);
}

TEST(FrameWindows, RunSlackIsTheThresholdLessTheSmallestWindowMaximum) {
  const Eigen::ArrayXd x = array({5.0, 1.0, 4.0, 2.0, 3.0, 9.0});
  const FrameMask all(6, true);
  EXPECT_EQ(run_slack_below(10.0, x, 1, all), 9.0);
  EXPECT_EQ(run_slack_below(10.0, x, 2, all), 7.0);  // 2, 3
  EXPECT_EQ(run_slack_below(10.0, x, 3, all), 6.0);  // 1, 4, 2 or 4, 2, 3
  EXPECT_EQ(run_slack_below(10.0, x, 6, all), 1.0);
  EXPECT_EQ(run_slack_below(10.0, x, 7, all), -kInfinity);
  EXPECT_EQ(run_slack_above(2.0, x, 2, all), 1.0);  // 3, 9
  EXPECT_EQ(count_slack_below(10.0, x, 2, all), 8.0);
  EXPECT_EQ(count_slack_above(2.0, x, 2, all), 3.0);  // 9, 5
}

TEST(FrameWindows, SlackKeepsToAllowedFramesWhereThereAreEnough) {
  const Eigen::ArrayXd x = array({1.0, 1.0, 5.0, 6.0, 7.0});
  EXPECT_EQ(run_slack_below(10.0, x, 2, {false, true, true, true, true}), 5.0);
  EXPECT_EQ(run_slack_below(10.0, x, 2, {true, false, true, false, true}), 9.0);  // no two in a row: all frames
  EXPECT_EQ(count_slack_below(10.0, x, 2, {true, false, true, false, true}), 5.0);
  EXPECT_EQ(count_slack_below(10.0, x, 2, {true, false, false, false, false}), 9.0);
}

}  // namespace
}  // namespace duet
