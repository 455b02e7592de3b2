// How a detector's verdict forms: what it would say of an episode had it ended at each of a row of frames.
#pragma once

#include <Eigen/Core>
#include <string>
#include <vector>

#include "duet/core/recording.h"
#include "duet/metrics/detector.h"

namespace duet {

struct DetectorTrace {
  DetectorVersion version = DetectorVersion::kRobot;
  ThresholdSet set = ThresholdSet::kPaper;
  std::vector<bool> evidence;      // of the whole episode, T entries
  std::vector<std::string> names;  // of the K margins
  std::vector<double> thresholds;  // that they are margins to; 1 where the detector has none of that name
  std::vector<std::string> units;  // of margins and thresholds
  std::vector<int> frames;         // of the S verdicts: the first looks at frames 0 to frames[0], ...
  std::vector<bool> success;       // S entries
  Eigen::MatrixXd margins;         // (S, K), in the margin's unit; NaN where it is undefined
};

// Every `stride` frames and at the last. Empty (no frames) for a recording without a partner or with numbers that are
// not finite. Throws std::invalid_argument for a recording of no task and for a robot that does not fit.
DetectorTrace detector_trace(const Recording& recording, const RobotModel& robot, DetectorVersion version,
                             ThresholdSet set, const DetectorReadings& readings, int stride);

}  // namespace duet
