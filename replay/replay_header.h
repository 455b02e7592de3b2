// The header of a replay's data: robots, people, limits, scenes and tracks, with the places of their columns.
#pragma once

#include <Eigen/Core>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "duet/core/recording.h"
#include "duet/metrics/detector.h"
#include "duet/replay/replay_content.h"

namespace duet {

// The numbers of a replay page: blocks of columns over time, quantised to 16 bits and stored as second differences,
// which a deflater makes small. viewer/src/columns.ts reads them.
class ReplayColumns {
 public:
  // A block of K columns of T values each; `values` is (T, K). A value is kept to half of `step`, or, in a column whose
  // range is more than 65,534 steps, to half of that part of its range; what is not finite stays so (as NaN). Returns
  // what the page's header says of it. Throws std::invalid_argument for a step that is not positive.
  nlohmann::json add(const Eigen::Ref<const Eigen::MatrixXd>& values, double step);

  [[nodiscard]] const std::string& bytes() const { return bytes_; }

 private:
  std::string bytes_;
};

// Adds every column of the content to `columns`.
nlohmann::json replay_header(const ReplayContent& content, ReplayColumns& columns);

// Links with their hinges, shapes and outline: all that forward kinematics and drawing take.
nlohmann::json robot_json(const RobotModel& robot);

// How a detector's verdict forms: what it would say of an episode had it ended at each of a row of frames.

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
