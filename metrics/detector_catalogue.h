// Every threshold of the detectors and every figure that they print, by task: Table S11 and the stricter set beside it,
// units and meanings, as the tasks' definitions say them. `duet list detectors` and docs/detectors.md come from here.
#pragma once

#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "duet/metrics/detector.h"
#include "duet/tasks/task_definition.h"

namespace duet {

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
