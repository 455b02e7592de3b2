// The six detectors of Algorithms 1-6 with Table S11. Each judges a *performer* and a *partner*; version `paper` takes
// them as printed (performer = human H, partner = robot R), version `robot` makes the robot the performer
// (docs/architecture.md, 6).
#pragma once

#include <map>
#include <string>
#include <string_view>
#include <vector>

#include "core/point_tracks.h"
#include "core/recording.h"
#include "core/robot_motion.h"
#include "core/task.h"
#include "metrics/readings.h"
#include "motion/human_motion.h"
#include "robots/robot_model.h"

namespace duet {

// Named tracks of one agent, each (3, T) [m], frame W; those that a detector does not need may stay empty.
struct Agent {
  Eigen::Matrix3Xd lhand, rhand, head, root, torso, lshoulder, rshoulder;
};

// Of the code of all detectors: rows carry it, and rows of two versions are never in one table. Raised whenever a
// verdict, a value or a margin of any clip changes (DetectorsVersion.StandsForTheseVerdicts says when).
inline constexpr std::string_view kDetectorsVersion = "1";

enum class DetectorVersion { kPaper, kRobot };
enum class ThresholdSet {
  kPaper,
  kStrict
};  // Table S11 | the stricter set, which also sets readings (docs/detectors.md)
std::string_view to_string(DetectorVersion version);  // "paper", "robot"
std::string_view to_string(ThresholdSet set);         // "paper", "strict"

using Thresholds = std::map<std::string, double>;  // names of Table S11 without tau_: "contact", "min_frames", ...
Thresholds thresholds(Task task, ThresholdSet set = ThresholdSet::kPaper);

struct DetectorResult {
  bool success = false;
  std::vector<bool> frames;              // evidence mask, T entries
  std::map<std::string, bool> parts;     // the printed sub-conditions by name
  std::map<std::string, double> values;  // what was measured
  // Per threshold, signed: by how much it could be tightened (positive) or must be loosened (negative) with the others
  // as they are; at exactly 0 the printed comparison decides. -infinity with fewer frames than are asked for. The
  // smallest has the sign of the verdict, for a hug "overall" (the best of its three modes) has.
  std::map<std::string, double> margins;
};

// Throws std::invalid_argument: a track that the task needs and is empty or has another length, a value that is not
// finite, an unknown threshold.
DetectorResult detect_performer(Task task, const Agent& performer, const Agent& partner, const Thresholds& thresholds,
                                const DetectorReadings& readings = {});

// Roles from the version: detect(t, human, robot, kRobot, ...) equals detect(t, robot, human, kPaper, ...).
DetectorResult detect(Task task, const Agent& human, const Agent& robot, DetectorVersion version,
                      ThresholdSet set = ThresholdSet::kPaper, DetectorReadings readings = {});

// Readings as the strict set wants them (bend forward, fly-kiss after_closest), others as given.
DetectorReadings strict_readings(DetectorReadings readings);

// SMPL-24: hands are joints 22 and 23, head 15, root 0, torso 9 (spine3), shoulders 16 and 17.
Agent human_agent(const PointTracks& smpl24);
// The frames that the card's `tracks` name; root is the base link. Throw std::invalid_argument for a motion of another
// number, or other names, of joints.
Agent robot_agent(const RobotModel& robot, const std::vector<RobotState>& states);
Agent robot_agent(const RobotModel& robot, const RobotMotion& motion);

}  // namespace duet
