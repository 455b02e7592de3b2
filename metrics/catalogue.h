// Every metric that duet prints: name, unit, direction, source. One table; names in files and reports come from here.
// The detectors' figures are in metrics/detector.h; forces of contacts carry their unit in their name
// (docs/file-formats.md, "Row").
#pragma once

#include <functional>
#include <map>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "duet/metrics/readings.h"
#include "duet/motion/paired_motion.h"
#include "duet/robots/robot_model.h"

namespace duet {

enum class Direction { kLower, kHigher, kNone };
// kOtherReading: of retargeting, under another reading than the default, printed beside it.
// kGrounding: how a retargeted motion stands (metrics/locomotion.h).
// kObject: what the hands do with a carried object (metrics/retargeting.h), of motions that have one.
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

// Metrics of paired motions by name: the 18 of metrics/retargeting.h, and those that a program adds. Thread-safe.

// A figure of one motion, in the unit that its MetricInfo says; NaN where it is not defined. Two threads may ask at
// once.
using MotionMetric = std::function<double(const PairedMotion& motion, const RobotModel& robot)>;

// From now on score_motion has this figure, too. The texts of `info` are copied; its group is kRetargeting whatever it
// says. Throws std::invalid_argument for a name that is empty or taken, by a metric of the catalogue or by another that
// was added, and where `metric` is empty.
void register_metric(const MetricInfo& info, MotionMetric metric);

// The metrics of score_motion: the catalogue's 18 in its order, then those added in theirs.
std::vector<MetricInfo> motion_metric_infos();

// Every one of them by name. Throws as retargeting_metrics, and what an added metric throws.
std::map<std::string, double> score_motion(const PairedMotion& motion, const RobotModel& robot,
                                           const MetricReadings& readings = {});

}  // namespace duet
