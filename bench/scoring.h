// From a rollout to an episode row: verdicts of the detectors, controller diagnostics, the 18 metrics of the executed
// motion.
#pragma once

#include "bench/rollout.h"
#include "bench/suite.h"
#include "metrics/readings.h"
#include "results/episode_row.h"

namespace duet {

// Fills outcome, success, verdicts, metrics, contacts and hashes of `row`. Success is false for every outcome but ok.
void score_rollout(const Rollout& rollout, const RolloutSetup& setup, const Suite& suite, const Readings& readings,
                   const RobotModel& robot, EpisodeRow& row);

// Root and hands, ten times a second: what tells when two engines part.
StateTrace state_trace(const Recording& recording, const RobotModel& robot);

// Heights of the soles, 25 times a second. Empty for a robot whose soles are not on two links.
FootTrace foot_trace(const Recording& recording, const RobotModel& robot);

// The executed motion in the place of the retargeted one, over the act (A.4.4 changes what is before and after): the 18
// metrics then say what the engine and the controller cost. As many frames as the act had before the episode ended.
PairedMotion executed_act(const Rollout& rollout, const RolloutSetup& setup, const RobotModel& robot);

Verdict to_verdict(const DetectorResult& result, DetectorVersion version, ThresholdSet set);

Readings readings_of(const Suite& suite);

}  // namespace duet
