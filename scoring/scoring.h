// The way from a rollout to an episode row: verdicts of the detectors, controller diagnostics, the 18 metrics of the
// executed motion.
#pragma once

#include <optional>
#include <string>

#include "duet/archives/npy/npz.h"
#include "duet/experiment/suite/suite.h"
#include "duet/metrics/retargeting.h"
#include "duet/rollout/act_episode.h"
#include "duet/rows/episode_row.h"

namespace duet {

// The people of the clip and the reshaped one, over the frames that the act had before the episode ended.
ScoringReference act_source(const Recording& recording, const RolloutSetup& setup);

// How a suite judges.
struct ScoringRules {
  DetectorVersion detector = DetectorVersion::kRobot;  // whose verdict is the headline
  ThresholdSet thresholds = ThresholdSet::kPaper;
  Readings readings = {};
  bool feet = false;  // whether the row has their trace
};

// Fills what follows from the motion alone: outcome, success, verdicts, traces, and into `row.metrics` onsets,
// diagnostics and the 18. Success is false for every outcome but ok.
void score_recording(const Recording& recording, const ScoringReference& source, const ScoringRules& rules,
                     const RobotModel& robot, EpisodeRow& row);

// The same of a rollout, and what was measured while it ran: contacts, forces, faults, times of plans, state hash.
void score_rollout(const Rollout& rollout, const RolloutSetup& setup, const ScoringRules& rules,
                   const RobotModel& robot, EpisodeRow& row);

// Scores an episode that a commanded velocity led: success where the robot was upright to the end, how it walked, and
// how it followed.
void score_walk(const Rollout& rollout, const SuiteReference& reference, const RobotModel& robot, EpisodeRow& row);

// Names in `row.metrics` of what is measured at the physics' rate.
std::vector<std::string> measured_metrics();

// Root and hands, ten times a second: what tells when two engines part.
StateTrace state_trace(const Recording& recording, const RobotModel& robot);

// Heights of the soles, 25 times a second. Empty for a robot whose soles are not on two links.
FootTrace foot_trace(const Recording& recording, const RobotModel& robot);

// SHA-256 over the states at 50 Hz.
std::string state_hash(const Recording& recording);

Verdict to_verdict(const DetectorResult& result, DetectorVersion version, ThresholdSet set);

// Frames that figures of a motion need: third differences at both ends.
inline constexpr int kShortestScored = 8;
// Those of the values that are finite.
void add_finite(const std::map<std::string, double>& values, std::map<std::string, double>& out);
void add_finite(const std::map<std::string, double>& values, NamedNumbers& out);
NamedNumbers finite_of(const NamedNumbers& values);

// The part of an episode that a run keeps (`record.trajectories`): its recording, with all that scoring it again takes.
// The file is a recording (docs/file-formats.md) with more keys; a recording of anybody else is read too.

// How the run judged the episode, and the row that it wrote but for wall_s.
struct KeptEpisode {
  EpisodeRow row;
  ScoringRules rules;
  ScoringReference source;
};

struct EpisodeRecording {
  Recording recording;
  std::optional<KeptEpisode> kept;  // empty: not from a run
};

// Throws InputError where the file cannot be written.
void save_episode_recording(const EpisodeRecording& episode, const std::string& path);
// Throws InputError naming the archive, the key and the fault.
EpisodeRecording read_episode_recording(const Npz& npz);

// The row again, from the motion: identity and what was measured at the physics' rate are the kept ones. Throws
// InputError for another robot than the row's.
EpisodeRow score_again(const Recording& recording, const KeptEpisode& kept, const RobotModel& robot);

}  // namespace duet
