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

bool judged_by_rule(Task task, ThresholdSet set) {
  return set == ThresholdSet::kAct && definition_of(task).rule != nullptr;
}

}  // namespace

std::span<const ThresholdInfo> threshold_catalogue(Task task) { return definition_of(task).detector.thresholds; }
std::span<const DetectorFigure> detector_figures(Task task) { return definition_of(task).detector.figures; }

std::span<const RuleThreshold> rule_thresholds(Task task) {
  const ActRule* rule = definition_of(task).rule;
  return rule != nullptr ? rule->thresholds : std::span<const RuleThreshold>{};
}

std::span<const DetectorFigure> rule_figures(Task task) {
  const ActRule* rule = definition_of(task).rule;
  return rule != nullptr ? rule->figures : std::span<const DetectorFigure>{};
}

const DetectorFigure& detector_figure(Task task, std::string_view name, ThresholdSet set) {
  return find_entry(judged_by_rule(task, set) ? rule_figures(task) : detector_figures(task), "figure", task, name);
}

const ThresholdInfo& threshold_info(Task task, std::string_view name) {
  return find_entry(threshold_catalogue(task), "threshold", task, name);
}

std::string_view threshold_unit(Task task, std::string_view name, ThresholdSet set) {
  if (!judged_by_rule(task, set)) return threshold_info(task, name).unit;
  return find_entry(rule_thresholds(task), "threshold", task, name).unit;
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
