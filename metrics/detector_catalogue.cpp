#include "duet/metrics/detector_catalogue.h"

#include <fmt/format.h>

#include <stdexcept>

#include "duet/core/names.h"
#include "duet/metrics/readings.h"

namespace duet {
namespace {

template <typename Entry>
const Entry& find_entry(std::span<const Entry> table, const char* kind, Task task, std::string_view name) {
  std::vector<std::string> known;
  for (const Entry& entry : table) {
    if (entry.name == name) return entry;
    known.emplace_back(entry.name);
  }
  throw std::invalid_argument(unknown_name_message(fmt::format("{} of {}", kind, to_string(task)), name, known));
}

}  // namespace

std::span<const ThresholdInfo> threshold_catalogue(Task task) { return definition_of(task).detector.thresholds; }
std::span<const DetectorFigure> detector_figures(Task task) { return definition_of(task).detector.figures; }

const DetectorFigure& detector_figure(Task task, std::string_view name) {
  return find_entry(detector_figures(task), "figure", task, name);
}

const ThresholdInfo& threshold_info(Task task, std::string_view name) {
  return find_entry(threshold_catalogue(task), "threshold", task, name);
}

std::vector<std::pair<std::string, std::string>> strict_choices(Task task) {
  Readings strict;
  strict.detectors = strict_readings({});
  std::vector<std::pair<std::string, std::string>> choices;
  for (const std::string& option : reading_names())
    if (option.starts_with(std::string(to_string(task)) + ".") && reading(strict, option) != reading({}, option))
      choices.emplace_back(option, reading(strict, option));
  return choices;
}

}  // namespace duet
