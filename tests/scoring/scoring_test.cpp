// The rules that make a row of a rollout: what is a success, what is a fall.
#include "duet/scoring/scoring.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "duet/backends/engine_module.h"
#include "duet/controllers/catalogue/registry.h"
#include "duet/execution/runner.h"
#include "duet/policies/catalogue/registry.h"
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

}  // namespace
}  // namespace duet
