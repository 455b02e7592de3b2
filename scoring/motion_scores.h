// Scores of retargeted motions: the 18 metrics, and the detectors before retargeting (human against human) and after
// (human against robot, played back without physics).
#pragma once

#include <map>
#include <memory>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "duet/metrics/detector.h"
#include "duet/metrics/readings.h"
#include "duet/metrics/retargeting.h"
#include "duet/motion/paired_motion.h"
#include "duet/robots/robot_model.h"

namespace duet {

// Detectors of any task over two agents, with what they measured: for people and robot, motions and recordings alike.

// Two agents and who is judged.
struct DetectorView {
  std::string name;  // "people", "robot", "printed"
  Agent human, robot;
  DetectorVersion version = DetectorVersion::kRobot;
};

// Views of a recording with a partner: "robot" and "printed", the robot's version and the paper's; none without one.
std::vector<DetectorView> robot_views(const Recording& recording, const RobotModel& robot);

struct DetectorScore {
  Task task = Task::kHug;
  std::string view;
  ThresholdSet thresholds = ThresholdSet::kPaper;
  DetectorResult result;
};

// Every task by every view. The strict set brings its readings.
std::vector<DetectorScore> score_detectors(const std::vector<Task>& tasks, const std::vector<DetectorView>& views,
                                           ThresholdSet thresholds, const DetectorReadings& readings);

// One column per view; a row for each verdict, condition, figure and threshold with its margin.
std::string detectors_table(const std::vector<DetectorScore>& scores);

// Accepted clips, by their task: how many of them each detector accepts, one column per view.
std::string acceptance_table(const std::map<std::string, std::vector<std::vector<DetectorScore>>>& clips);

// {task: {view: {success, parts, values, thresholds, margins, evidence_frames}}}; what is not finite is null.
nlohmann::json detectors_json(const std::vector<DetectorScore>& scores);

struct ScoreOptions {
  Readings readings = {};
  ThresholdSet thresholds = ThresholdSet::kPaper;
  bool all_detectors = false;  // every task's, with what they measured
  bool all_readings = false;   // the metrics under every reading
};

struct ClipScore {
  std::string clip, task;
  std::map<std::string, double> metrics;  // the 18, jpe.pelvis, large_angle_ratio.entry, those of metrics/locomotion.h
                                          // and, with an object, metrics/retargeting.h; NaN where undefined
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
