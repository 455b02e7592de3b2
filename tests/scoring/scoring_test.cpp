// The rules that make a row of a rollout: what is a success, what is a fall.
#include "duet/scoring/scoring.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "duet/backends/engine_module.h"
#include "duet/controllers/catalogue/registry.h"
#include "duet/execution/runner.h"
#include "duet/policies/catalogue/registry.h"
#include "duet/scoring/motion_scores.h"
#include "tests/execution/staged.h"
#include "tests/experiment/fixtures.h"

namespace duet {
namespace {

// A wave played back as it was retargeted: the headline detector finds it.
class WaveThatSucceeds : public testing::Test {
 protected:
  [[nodiscard]] EpisodeRow scored() const {
    EpisodeRow row;
    score_rollout(rollout_, setup_, rules_, *robot_, row);
    return row;
  }

  std::shared_ptr<const RobotModel> robot_ = test::g1();
  std::shared_ptr<const Experiment> experiment_ =
      test::experiment_of(test::playback_suite(), {test::paired(Task::kWave, *robot_)});
  ScoringRules rules_;
  RolloutSetup setup_ = experiment_->setup(test::first_of(*experiment_));
  Rollout rollout_ = [this] {
    const auto policy = make_policy("replay_dense", robot_);
    return play_back(setup_, *policy);
  }();
};

TEST_F(WaveThatSucceeds, IsASuccessWhereTheEpisodeEndedWell) {
  const EpisodeRow row = scored();
  EXPECT_EQ(row.success, true);
  EXPECT_FALSE(row.fell);
  EXPECT_EQ(row.verdicts.size(), 4U);
}

TEST_F(WaveThatSucceeds, IsNoneWhereTheRobotFellOrTheEpisodeEndedInAnyOtherWay) {
  for (const Outcome outcome : {Outcome::kFell, Outcome::kDiverged, Outcome::kTimedOut, Outcome::kError}) {
    rollout_.recording.outcome = outcome;
    const EpisodeRow row = scored();
    EXPECT_EQ(row.success, false) << to_string(outcome);
    EXPECT_EQ(row.fell, outcome == Outcome::kFell);
    // The detectors see the motion all the same.
    EXPECT_TRUE(std::any_of(row.verdicts.begin(), row.verdicts.end(), [](const Verdict& v) { return v.success; }));
  }
}

TEST_F(WaveThatSucceeds, SuccessIsTheVerdictOfTheSuitesDetectorAndThresholdsAlone) {
  for (const DetectorVersion version : {DetectorVersion::kRobot, DetectorVersion::kPaper})
    for (const ThresholdSet set : kThresholdSets) {
      rules_.detector = version;
      rules_.thresholds = set;
      const EpisodeRow row = scored();
      const auto own = std::find_if(row.verdicts.begin(), row.verdicts.end(), [&](const Verdict& verdict) {
        return verdict.version == to_string(version) && verdict.thresholds == to_string(set);
      });
      ASSERT_NE(own, row.verdicts.end());
      EXPECT_EQ(row.success, own->success) << own->version << " " << own->thresholds;
    }
}

TEST_F(WaveThatSucceeds, TheRulesOfTheActAreAskedWhereTheSuiteAsksForThem) {
  rules_.thresholds = ThresholdSet::kAct;
  EXPECT_EQ(scored().verdicts.size(), 6U);
}

TEST_F(WaveThatSucceeds, ANullPolicyIsNoSuccess) {
  for (RobotState& state : rollout_.recording.robot) state.q = robot_->neutral;
  EXPECT_EQ(scored().success, false);
}

TEST_F(WaveThatSucceeds, SimulatedTimeIsFramesOverTheirRate) {
  const EpisodeRow row = scored();
  EXPECT_EQ(row.frames, rollout_.recording.frames());
  EXPECT_DOUBLE_EQ(row.sim_s * 50.0, row.frames);
}

TEST_F(WaveThatSucceeds, ShorterThanEightFramesHasNoMetricsAndEightHas) {
  for (const int frames : {7, 8}) {
    Rollout part = rollout_;
    part.recording.robot.resize(frames);
    part.recording.reference.resize(frames);
    part.recording.q_target.resize(frames);
    part.recording.partner = part.recording.partner.slice(0, frames);
    EpisodeRow row;
    score_rollout(part, setup_, rules_, *robot_, row);
    EXPECT_EQ(row.metrics.contains("dof_error"), frames == 8) << frames;
  }
}

// The 18 of a recording are those of the motion that its act is, cut out and put beside the same people.
TEST_F(WaveThatSucceeds, MetricsOfTheActAreThoseOfTheMotionThatItIs) {
  const Recording& recording = rollout_.recording;
  const ScoringReference source = act_source(recording, setup_);
  const int begin = recording.phases.act_begin, frames = act_frames(recording);
  ASSERT_EQ(frames, recording.phases.act_end - begin);
  PairedMotion motion;
  motion.partner.joints = recording.partner.slice(begin, begin + frames);
  motion.source_partner = source.partner;
  motion.source_reactor = source.reactor;
  motion.reshaped = source.reshaped;
  motion.robot.q.resize(robot_->dof(), frames);
  for (int t = 0; t < frames; ++t) {
    motion.robot.root.push_back(recording.robot[begin + t].X_WB);
    motion.robot.q.col(t) = recording.robot[begin + t].q;
  }
  const std::map<std::string, double> expected = retargeting_metrics(motion, *robot_);
  const std::map<std::string, double> found = retargeting_metrics(recording, source, *robot_);
  ASSERT_EQ(found.size(), 18U);
  for (const auto& [name, value] : expected)
    if (std::isfinite(value)) {
      EXPECT_EQ(found.at(name), value) << name;
    }
}

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
