// The detectors of all tasks, those of Algorithms 1-6 with Table S11 among them (tasks/). Each judges a *performer* and
// a *partner*; version `paper` takes them as printed (performer = human H, partner = robot R), version `robot` makes
// the robot the performer (docs/architecture.md, 6).
#pragma once

#include <array>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "duet/core/recording.h"
#include "duet/core/task.h"
#include "duet/metrics/readings.h"
#include "duet/motion/human_motion.h"
#include "duet/robots/robot_model.h"
#include "duet/tasks/task_definition.h"

namespace duet {

// The version of the code of all detectors: rows carry it, and rows of two versions are never in one table. Raised
// whenever a verdict, a value or a margin of any clip changes (DetectorsVersion.StandsForTheseVerdicts says when).
inline constexpr std::string_view kDetectorsVersion = "1";

// `kInteraction` is no view of a detector but the rule of metrics/interaction.h, which asks the set `act` of the robot
// and more; `detect` refuses it.
enum class DetectorVersion { kPaper, kRobot, kInteraction };
// Table S11 | the stricter set, which also sets readings | the set of rules that know the act, where a task has one,
// else the strict one (docs/detectors.md).
enum class ThresholdSet { kPaper, kStrict, kAct };
inline constexpr std::array kThresholdSets = {ThresholdSet::kPaper, ThresholdSet::kStrict, ThresholdSet::kAct};
std::string_view to_string(DetectorVersion version);  // "paper", "robot", "interaction"
std::string_view to_string(ThresholdSet set);         // "paper", "strict", "act"

// Throws std::invalid_argument for another name, and lists these.
ThresholdSet parse_threshold_set(std::string_view name);

Thresholds thresholds(Task task, ThresholdSet set = ThresholdSet::kPaper);

// Throws std::invalid_argument: a track that the task needs and is empty or has another length, a value that is not
// finite, an unknown threshold.
DetectorResult detect_performer(Task task, const Agent& performer, const Agent& partner, const Thresholds& thresholds,
                                const DetectorReadings& readings = {});

// Detects by the task's rule of the set `act`. Throws std::invalid_argument as above, and for a task that has none.
DetectorResult detect_by_rule(Task task, const Agent& performer, const Agent& partner, const Thresholds& thresholds);

// Two agents as the rules look at them: smoothed once for all of them.
struct SmoothedAgents {
  Agent performer, partner;
};
// Throws as detect_performer, for what any rule needs.
SmoothedAgents smoothed_for_rules(const Agent& performer, const Agent& partner);
// detect_by_rule with the rule's own thresholds.
DetectorResult detect_by_rule(Task task, const SmoothedAgents& agents);

// Roles from the version: detect(t, human, robot, kRobot, ...) equals detect(t, robot, human, kPaper, ...).
DetectorResult detect(Task task, const Agent& human, const Agent& robot, DetectorVersion version,
                      ThresholdSet set = ThresholdSet::kPaper, DetectorReadings readings = {});

// SMPL-24: hands are joints 22 and 23, head 15, root 0, torso 9 (spine3), shoulders 16 and 17.
Agent human_agent(const PointTracks& smpl24);
// The frames that the card's `tracks` name; root is the base link. Throw std::invalid_argument for a motion of another
// number, or other names, of joints.
Agent robot_agent(const RobotModel& robot, const std::vector<RobotState>& states);
Agent robot_agent(const RobotModel& robot, const RobotMotion& motion);

// Every threshold of the detectors and every figure that they print, by task: Table S11 and the stricter set beside it,
// units and meanings, as the tasks' definitions say them. `duet list detectors` and docs/detectors.md come from here.

// In the order of Table S11.
std::span<const ThresholdInfo> threshold_catalogue(Task task);
std::span<const DetectorFigure> detector_figures(Task task);
// The thresholds and figures of the task's rule of the set `act`; empty where it has none.
std::span<const RuleThreshold> rule_thresholds(Task task);
std::span<const DetectorFigure> rule_figures(Task task);
// Throw std::invalid_argument for a name that the task's detector does not have, with the nearest.
const DetectorFigure& detector_figure(Task task, std::string_view name, ThresholdSet set = ThresholdSet::kPaper);
const ThresholdInfo& threshold_info(Task task, std::string_view name);
std::string_view threshold_unit(Task task, std::string_view name, ThresholdSet set);

// The readings that the strict set chooses: option and reading.
std::vector<std::pair<std::string, std::string>> strict_choices(Task task);

}  // namespace duet
