// Metrics of paired motions by name: the 18 of metrics/retargeting.h, and those that a program adds. Thread-safe.
#pragma once

#include <functional>
#include <map>
#include <string>
#include <vector>

#include "duet/metrics/catalogue.h"
#include "duet/metrics/readings.h"
#include "duet/motion/paired_motion.h"
#include "duet/robots/robot_model.h"

namespace duet {

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
