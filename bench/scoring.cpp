#include "bench/scoring.h"

#include <algorithm>
#include <cmath>

#include "metrics/detector.h"
#include "metrics/diagnostics.h"
#include "metrics/retargeting.h"

namespace duet {
namespace {

HumanMotion cut(const HumanMotion& motion, int begin, int frames) {
  return slice(motion, begin, std::min(begin + frames, motion.frames()));
}

void add_finite(const std::map<std::string, double>& values, std::map<std::string, double>& out) {
  for (const auto& [name, value] : values)
    if (std::isfinite(value)) out[name] = value;
}

}  // namespace

Readings readings_of(const Suite& suite) {
  Readings readings;
  for (const auto& [option, value] : suite.readings) set_reading(readings, option, value);
  return readings;
}

Verdict to_verdict(const DetectorResult& result, DetectorVersion version, ThresholdSet set) {
  Verdict verdict;
  verdict.version = to_string(version);
  verdict.thresholds = to_string(set);
  verdict.success = result.success;
  verdict.parts = result.parts;
  add_finite(result.values, verdict.values);
  add_finite(result.margins, verdict.margins);
  verdict.frames = static_cast<int>(std::count(result.frames.begin(), result.frames.end(), true));
  return verdict;
}

PairedMotion executed_motion(const Rollout& rollout, const RolloutSetup& setup, const RobotModel& robot) {
  const int frames = std::min(rollout.recording.frames(), setup.clip->frames() - setup.reference.clip_frame);
  const int begin = setup.reference.clip_frame;
  PairedMotion motion;
  motion.clip_id = setup.clip->clip_id;
  motion.task = setup.clip->task;
  motion.phases = rollout.recording.phases;
  motion.reactor = setup.clip->reactor;
  motion.partner = cut(setup.clip->partner, begin, frames);
  motion.source_partner = cut(setup.clip->source_partner, begin, frames);
  motion.source_reactor = cut(setup.clip->source_reactor, begin, frames);
  motion.reshaped = setup.clip->reshaped.slice(begin, begin + frames);
  motion.robot.joint_names = robot.joint_names();
  motion.robot.q.resize(robot.dof(), frames);
  for (int t = 0; t < frames; ++t) {
    motion.robot.root.push_back(rollout.recording.robot[t].X_WB);
    motion.robot.q.col(t) = rollout.recording.robot[t].q;
  }
  return motion;
}

void score_rollout(const Rollout& rollout, const RolloutSetup& setup, const Suite& suite, const Readings& readings,
                   const RobotModel& robot, EpisodeRow& row) {
  const Recording& recording = rollout.recording;
  const Agent human = human_agent(recording.partner);
  const Agent machine = robot_agent(robot, recording.robot);
  row.outcome = recording.outcome;
  row.message = recording.message;
  row.fell = recording.outcome == Outcome::kFell;
  row.frames = recording.frames();
  row.sim_s = recording.frames() / recording.rate_hz;
  row.late_plans = rollout.late_plans;
  row.contact_peak_n = rollout.contact_peak;
  row.contact_impulse_ns = rollout.contact_impulse;
  row.state_hash = rollout.state_hash;
  row.success = false;
  for (const DetectorVersion version : {DetectorVersion::kRobot, DetectorVersion::kPaper}) {
    for (const ThresholdSet set : {ThresholdSet::kPaper, ThresholdSet::kStrict}) {
      const DetectorResult result = detect(recording.task, human, machine, version, set, readings.detectors);
      row.verdicts.push_back(to_verdict(result, version, set));
      if (version == suite.detector && set == suite.thresholds)
        row.success = result.success && recording.outcome == Outcome::kOk;
    }
  }
  constexpr int kShortest = 8;  // third differences at both ends
  if (recording.frames() < kShortest) return;
  add_finite(controller_diagnostics(recording, readings.diagnostics), row.metrics);
  const PairedMotion executed = executed_motion(rollout, setup, robot);
  if (executed.frames() >= kShortest) add_finite(retargeting_metrics(executed, robot, readings.metrics), row.metrics);
}

}  // namespace duet
