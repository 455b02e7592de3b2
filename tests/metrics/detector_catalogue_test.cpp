#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "duet/core/digest.h"
#include "duet/core/file.h"
#include "duet/core/task.h"
#include "duet/metrics/detector.h"
#include "duet/metrics/readings.h"
#include "tests/metrics/acting.h"
#include "tests/support.h"

namespace duet {
namespace {

using ::testing::ElementsAre;
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

// The version of the detectors' code stands for what they say of fixed motions: where that changes, it must be raised,
// as rows of two versions are never in one table.

constexpr std::string_view kVersion = "1";
constexpr std::string_view kDigest = "57079e6c75754bab9c5e3b72d82295494c41bf49dd078ee2748b5fd49df21e47";

// Sines differ in the last bits between libraries; six decimals do not.
std::string rounded(double value) { return fmt::format("{:.6f}", std::abs(value) < 5e-7 ? 0.0 : value); }

std::string text_of(const DetectorResult& result) {
  std::string text = result.success ? "success" : "failure";
  for (const auto& [name, holds] : result.parts) text += fmt::format(" {}={}", name, holds);
  for (const auto& [name, value] : result.values) text += fmt::format(" {}={}", name, rounded(value));
  for (const auto& [name, margin] : result.margins) text += fmt::format(" {}={}", name, rounded(margin));
  for (const bool frame : result.frames) text += frame ? '1' : '0';
  return text + "\n";
}

std::string verdicts_of_fixed_motions() {
  std::string text;
  for (const Task task : kPaperTasks) {
    for (std::uint64_t seed = 1; seed <= 40; ++seed) {
      const test::Scene scene = test::acting(task, seed);
      for (const DetectorVersion version : {DetectorVersion::kPaper, DetectorVersion::kRobot})
        for (const ThresholdSet set : {ThresholdSet::kPaper, ThresholdSet::kStrict})
          text += fmt::format("{} {} {}", to_string(task), seed,
                              text_of(detect(task, scene.partner, scene.performer, version, set)));
    }
  }
  return text;
}

TEST(DetectorsVersion, StandsForTheseVerdicts) {
  EXPECT_EQ(sha256_hex(verdicts_of_fixed_motions()), kDigest)
      << "the detectors' output changed: raise kDetectorsVersion (metrics/detector.h) and take the new digest here, "
         "together";
  EXPECT_EQ(kDetectorsVersion, kVersion);
}

TEST(DetectorsVersion, FixedMotionsSucceedAndFail) {
  const std::string text = verdicts_of_fixed_motions();
  for (const Task task : kPaperTasks) {
    const std::string name(to_string(task));
    int successes = 0, failures = 0;
    for (std::size_t at = 0; (at = text.find(name + " ", at)) != std::string::npos; ++at) {
      const std::string line = text.substr(at, text.find('\n', at) - at);
      line.find("success ") != std::string::npos ? ++successes : ++failures;
    }
    EXPECT_GT(successes, 5) << name;
    EXPECT_GT(failures, 5) << name;
  }
}

TEST(Readings, DefaultsAreTheFirstOfEachRow) {
  const Readings defaults;
  for (const std::string& name : reading_names()) EXPECT_EQ(reading(defaults, name), reading_values(name).front());
}

TEST(Readings, EveryValueOfEveryOptionRoundTrips) {
  for (const std::string& name : reading_names()) {
    for (const std::string& value : reading_values(name)) {
      Readings readings;
      set_reading(readings, name, value);
      EXPECT_EQ(reading(readings, name), value) << name;
    }
  }
}

TEST(Readings, SettingOneOptionLeavesTheOthers) {
  for (const std::string& name : reading_names()) {
    Readings readings;
    set_reading(readings, name, reading_values(name).back());
    for (const std::string& other : reading_names()) {
      if (other != name) {
        EXPECT_EQ(reading(readings, other), reading_values(other).front()) << name << " " << other;
      }
    }
  }
}

TEST(Readings, NamesReachTheirMembers) {
  Readings readings;
  set_reading(readings, "metrics.matching", "source_sequence");
  set_reading(readings, "metrics.ddof", "1");
  set_reading(readings, "handshake.ddof", "1");
  set_reading(readings, "wave.displacement", "since_last");
  set_reading(readings, "fly_kiss.order", "after_first_close");
  set_reading(readings, "diagnostics.root_jerk", "rms");
  set_reading(readings, "diagnostics.dof_jerk", "mean_norm");
  EXPECT_EQ(readings.metrics.matching, HandMatching::kSourceSequence);
  EXPECT_EQ(readings.metrics.ddof, 1);
  EXPECT_EQ(readings.detectors.handshake_ddof, 1);
  EXPECT_EQ(readings.detectors.wave_displacement, WaveDisplacement::kSinceLast);
  EXPECT_EQ(readings.detectors.fly_kiss_order, FlyKissOrder::kAfterFirstClose);
  EXPECT_EQ(readings.diagnostics.root_jerk, JerkNorm::kRms);
  EXPECT_EQ(readings.diagnostics.dof_jerk, JerkNorm::kMeanNorm);
}

TEST(Readings, ListsTheNamesOfTheReferencePage) {
  EXPECT_EQ(reading_names().size(), 37U);
  EXPECT_THAT(reading_values("metrics.matching"),
              ElementsAre("independent_frame", "source_frame", "independent_sequence", "source_sequence",
                          "independent_bottleneck"));
  EXPECT_THAT(reading_values("diagnostics.root_jerk"), ElementsAre("mean_norm", "rms"));
  EXPECT_THAT(reading_values("high_five.height"),
              ElementsAre("closest_pair", "performer_closest", "partner_closest", "any_hand", "performer_any", "off"));
}

TEST(Readings, MinFramesTakesWholeNumbersFromOne) {
  Readings readings;
  set_reading(readings, "metrics.min_frames", "12");
  EXPECT_EQ(readings.metrics.min_frames, 12);
  EXPECT_EQ(reading(readings, "metrics.min_frames"), "12");
  for (const char* wrong : {"0", "-1", "2.5", "", "two", "3 ", "99999999999999999999"})
    EXPECT_SENTENCE(
        test::thrown_message<std::invalid_argument>([&] { set_reading(readings, "metrics.min_frames", wrong); }));
}

TEST(Readings, RefusesUnknownNamesAndListsTheKnownOnes) {
  Readings readings;
  const std::string option =
      test::thrown_message<std::invalid_argument>([&] { set_reading(readings, "metrics.jpe_fram", "world"); });
  EXPECT_THAT(option, HasSubstr("metrics.jpe_frame"));
  EXPECT_THAT(option, HasSubstr("metrics.min_frames"));  // of so many, the near ones
  const std::string value =
      test::thrown_message<std::invalid_argument>([&] { set_reading(readings, "hug.single", "all"); });
  EXPECT_THAT(value, HasSubstr("hug.single"));
  EXPECT_THAT(value, HasSubstr("any_hand, same_hand, exactly_one, off"));
  EXPECT_SENTENCE(test::thrown_message<std::invalid_argument>([&] { (void)reading(readings, "nothing"); }));
  EXPECT_SENTENCE(test::thrown_message<std::invalid_argument>([] { (void)reading_values("nothing"); }));
  // root_jerk has no mean over axes.
  EXPECT_SENTENCE(
      test::thrown_message<std::invalid_argument>([&] { set_reading(readings, "diagnostics.root_jerk", "mean_abs"); }));
}

}  // namespace
}  // namespace duet
