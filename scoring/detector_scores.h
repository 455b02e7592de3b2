// Detectors of any task over two agents, with what they measured: for people and robot, motions and recordings alike.
#pragma once

#include <map>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "duet/metrics/detector.h"

namespace duet {

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

}  // namespace duet
