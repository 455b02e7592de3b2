// Every metric that duet prints: name, unit, direction, source. One table; names in files and reports come from here.
// The detectors' figures are in metrics/detector_catalogue.h; forces of contacts carry their unit in their name
// (docs/file-formats.md, "Row").
#pragma once

#include <span>
#include <string_view>

namespace duet {

enum class Direction { kLower, kHigher, kNone };
// kOtherReading: of retargeting, under another reading than the default, printed beside it.
// kGrounding: how a retargeted motion stands (metrics/grounding.h).
// kObject: what the hands do with a carried object (metrics/object_metrics.h), of motions that have one.
enum class MetricGroup { kRetargeting, kOtherReading, kGrounding, kObject, kController, kEpisode };

struct MetricInfo {
  std::string_view name;  // "jpe", "contact_f1_0.35", "hf_ratio", ...
  std::string_view unit;  // "m", "1", "m/s^3", ...
  Direction direction;
  MetricGroup group;
  std::string_view title;   // for tables and plots: "Joint position error"
  std::string_view source;  // "supplement C.2.1"
};

std::span<const MetricInfo> metric_catalogue();
// Throws std::invalid_argument for an unknown name, with the nearest.
const MetricInfo& metric_info(std::string_view name);
// The metric of a figure of retargeting_metrics_all_readings: "jerk_mean.links.diff" is a jerk_mean. Throws likewise.
const MetricInfo& metric_of_reading(std::string_view name);

}  // namespace duet
