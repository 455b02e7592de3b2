// Scores of retargeted motions: the 18 metrics, and the detectors before retargeting (human against human) and after
// (human against robot, played back without physics).
#pragma once

#include <map>
#include <memory>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "duet/metrics/readings.h"
#include "duet/metrics/retargeting.h"
#include "duet/motion/paired_motion.h"
#include "duet/robots/robot_model.h"
#include "duet/scoring/detector_scores.h"

namespace duet {

struct ScoreOptions {
  Readings readings = {};
  ThresholdSet thresholds = ThresholdSet::kPaper;
  bool all_detectors = false;  // every task's, with what they measured
  bool all_readings = false;   // the metrics under every reading
};

struct ClipScore {
  std::string clip, task;
  std::map<std::string, double> metrics;  // the 18, jpe.pelvis, large_angle_ratio.entry, those of metrics/grounding.h
                                          // and, with an object, metrics/object_metrics.h; NaN where undefined
  std::map<std::string, double> all_readings;  // of retargeting_metrics_all_readings, where asked for
  std::vector<DetectorScore> detectors;        // likewise
  std::array<ContactCounts, 3> contacts, object_contacts;
  bool source_detected = false;  // person against person, the reactor as performer
  bool robot_detected = false;   // version `robot`, played back
  bool paper_detected = false;   // version `paper`, played back
};

ClipScore score_clip(const PairedMotion& motion, const std::shared_ptr<const RobotModel>& robot,
                     const ScoreOptions& options = {});

// Per task and "all": mean of each metric over clips (contact figures from summed counts: micro average), detector
// rates under "source_detected", "robot_detected", "paper_detected", and "clips".
std::map<std::string, std::map<std::string, double>> summarize_scores(const std::vector<ClipScore>& scores,
                                                                      const MetricReadings& readings);

// A table for a terminal: one column a task, one row a metric.
std::string score_table(const std::map<std::string, std::map<std::string, double>>& summary);
// The metrics under every reading: mean over the clips that have a value, contact figures too. Empty where none was
// asked for.
std::string readings_table(const std::vector<ClipScore>& scores);

nlohmann::json score_json(const std::vector<ClipScore>& scores,
                          const std::map<std::string, std::map<std::string, double>>& summary);

}  // namespace duet
