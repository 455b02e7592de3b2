// Every threshold of the detectors and every figure that they print, by task: Table S11 and the stricter set beside it,
// units and meanings. One table: `thresholds`, `duet list detectors` and docs/detectors.md come from here.
#pragma once

#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "core/task.h"

namespace duet {

struct ThresholdInfo {
  Task task;
  std::string_view name;  // of Table S11 without tau_
  double paper, strict;
  std::string_view unit;
  std::string_view meaning;
};

// By task, in the order of Table S11.
std::span<const ThresholdInfo> threshold_catalogue();

struct DetectorFigure {
  Task task;
  std::string_view name;  // in DetectorResult::values
  std::string_view unit;
  std::string_view meaning;
};

std::span<const DetectorFigure> detector_figures();
// Throws std::invalid_argument for a name that the task's detector does not print, with the nearest.
const DetectorFigure& detector_figure(Task task, std::string_view name);
const ThresholdInfo& threshold_info(Task task, std::string_view name);

// The readings that the strict set chooses: option and reading.
std::vector<std::pair<std::string, std::string>> strict_choices(Task task);

}  // namespace duet
