// Laws of every task's definition, whichever tasks there are.
#include "duet/tasks/task_definition.h"

#include <gmock/gmock.h>

#include <map>
#include <set>
#include <string>

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

}  // namespace
}  // namespace duet
