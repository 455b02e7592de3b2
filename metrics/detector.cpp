#include "duet/metrics/detector.h"

#include <fmt/format.h>

#include <cmath>
#include <stdexcept>

#include "duet/core/names.h"
#include "duet/core/require.h"

namespace duet {
namespace {

void check_tracks(Task task, const Tracks& tracks) {
  const Eigen::Index frames = tracks.front().track->cols();
  for (const auto& [name, track] : tracks) {
    require(track->cols() > 0, fmt::format("{} detector: the track {} is needed and empty", to_string(task), name));
    require(track->cols() == frames, fmt::format("{} detector: the track {} has {} frames, but {} has {}",
                                                 to_string(task), name, track->cols(), tracks.front().name, frames));
    if (track->allFinite()) continue;
    for (Eigen::Index t = 0; t < frames; ++t)
      require(track->col(t).allFinite(),
              fmt::format("{} detector: the track {} is not finite at frame {}", to_string(task), name, t));
  }
}

// The task's thresholds with those given in the place of the printed ones.
Thresholds completed(Task task, const Thresholds& given) {
  Thresholds complete = thresholds(task);
  for (const auto& [name, value] : given) {
    const auto known = complete.find(name);
    if (known == complete.end()) {
      std::vector<std::string> names;
      for (const auto& entry : complete) names.push_back(entry.first);
      throw std::invalid_argument(unknown_name_message(fmt::format("threshold of {}", to_string(task)), name, names));
    }
    require(std::isfinite(value), fmt::format("threshold {} of {} is not finite", name, to_string(task)));
    known->second = value;
  }
  return complete;
}

}  // namespace

std::string_view to_string(DetectorVersion version) { return version == DetectorVersion::kPaper ? "paper" : "robot"; }
std::string_view to_string(ThresholdSet set) { return set == ThresholdSet::kPaper ? "paper" : "strict"; }

Thresholds thresholds(Task task, ThresholdSet set) {
  Thresholds tau;
  for (const ThresholdInfo& info : definition_of(task).detector.thresholds)
    tau[std::string(info.name)] = set == ThresholdSet::kStrict ? info.strict : info.paper;
  return tau;
}

DetectorResult detect_performer(Task task, const Agent& performer, const Agent& partner, const Thresholds& thresholds,
                                const DetectorReadings& readings) {
  const TaskDetector& detector = definition_of(task).detector;
  check_tracks(task, detector.tracks(performer, partner, readings));
  return detector.detect(performer, partner, completed(task, thresholds), readings);
}

DetectorResult detect(Task task, const Agent& human, const Agent& robot, DetectorVersion version, ThresholdSet set,
                      DetectorReadings readings) {
  if (set == ThresholdSet::kStrict) readings = strict_readings(readings);
  const bool paper = version == DetectorVersion::kPaper;
  return detect_performer(task, paper ? human : robot, paper ? robot : human, thresholds(task, set), readings);
}

}  // namespace duet
